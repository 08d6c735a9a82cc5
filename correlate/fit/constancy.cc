#include "correlate/fit/constancy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "base/dense.h"
#include "base/random.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/fit/constancy_rows.h"
#include "correlate/fit/series_noise.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// What the groups take of the residuals, all together and each alone.
struct Taken {
  // Of the looks, -2 log of the least p-value [-]; their number.
  double statistic = 0.0, looks = 0.0;
  int most = -1;       // the group that takes most
  bool white = false;  // no noise with a memory was found: the ratio's distribution is known
};

// Of residuals whitened by one noise: sums of squares that the fit leaves, that it leaves with all
// groups, and with each.
struct Left {
  double without = 0.0, with = 0.0;
  std::vector<double> alone;
  double fitted = 0.0, freedoms = 0.0;  // columns
  std::vector<double> alone_freedoms;
  double log_variances = 0.0;  // of the noise

  // Twice a log-likelihood, but for a constant, of noise that is known but for a factor.
  double Gain(double rows, double squares) const {
    return -rows * std::log(std::max(squares, 1e-300) / rows) - log_variances;
  }
};

// `rows` come out whitened.
Left LeftBy(const RowWhitening& whitening, QuestionRows* rows) {
  Left out;
  out.log_variances = whitening.LogVariances(rows->residual);
  rows->Whiten(whitening);
  const Eigen::Index n = rows->own.rows();
  const Eigen::MatrixXd basis = Beyond(Eigen::MatrixXd(n, 0), rows->own);
  const Eigen::VectorXd r = rows->residual - basis * (basis.transpose() * rows->residual);
  out.without = r.squaredNorm();
  Eigen::MatrixXd every(n, rows->added);
  Eigen::Index at = 0;
  for (const Eigen::MatrixXd& g : rows->groups) {
    every.middleCols(at, g.cols()) = g;
    at += g.cols();
    const Eigen::MatrixXd own = Beyond(basis, g);
    // r is model less data: a law that the data want has the opposite sign.
    const bool wanted = !rows->one_sided || g.col(0).dot(r) < 0.0;
    out.alone.push_back(wanted ? out.without - (own.transpose() * r).squaredNorm() : out.without);
    out.alone_freedoms.push_back(static_cast<double>(own.cols()));
  }
  const Eigen::MatrixXd space = Beyond(basis, std::move(every));
  out.fitted = static_cast<double>(basis.cols());
  out.freedoms = static_cast<double>(space.cols());
  out.with = out.without - (space.transpose() * r).squaredNorm();
  return out;
}

bool HasMemory(const SeriesNoise& noise) {
  return std::any_of(noise.series.begin(), noise.series.end(),
                     [](const MarkovNoise& n) { return !n.white(); });
}

// `whitened`: the rows by the noise found with all columns.
Taken Take(const Observations& o, const Eigen::MatrixXd& all, const QuestionRows& rows,
           QuestionRows* whitened) {
  *whitened = rows;
  QuestionRows plain = rows;
  const SeriesNoise noise_with = FitSeriesNoise(o, rows.residual, all);
  const SeriesNoise noise_without = FitSeriesNoise(o, rows.residual, rows.own);
  const Left with = LeftBy(RowWhitening(o, noise_with), whitened);
  const Left without = LeftBy(RowWhitening(o, noise_without), &plain);
  const double n = rows.count;
  // Each at the better of two noises: the likelihoods' maxima lie near those of the restricted one.
  auto best = [&](double a, double b) { return std::max(with.Gain(n, a), without.Gain(n, b)); };
  const double fit = best(with.without, without.without);
  // Bartlett's correction of a linear model's ratio: chi-square to second order.
  auto chance = [&](double ratio, double freedoms) {
    if (freedoms == 0.0) return 1.0;
    const double factor = (n - with.fitted - 0.5 * freedoms - 1.0) / n;
    return ChiSquareTail(std::max(0.0, factor * ratio), freedoms);
  };
  Taken out;
  out.white = !HasMemory(noise_with) && !HasMemory(noise_without);
  const bool several = rows.groups.size() > 1;  // else all together are the one
  double least = several ? chance(best(with.with, without.with) - fit, with.freedoms) : 1.0;
  double least_alone = 1.0;
  out.looks = several ? 1.0 : 0.0;
  for (std::size_t g = 0; g < with.alone.size(); ++g) {
    if (with.alone_freedoms[g] == 0.0) continue;
    out.looks += 1.0;
    const double p = (rows.one_sided ? 0.5 : 1.0) *
                     chance(best(with.alone[g], without.alone[g]) - fit, with.alone_freedoms[g]);
    if (p < least_alone) least_alone = p, out.most = static_cast<int>(g);
  }
  out.statistic = -2.0 * std::log(std::max(1e-300, std::min(least, least_alone)));
  return out;
}

// Of the least of `looks` even p-values, whose logarithms are larger by `scale` [Bonferroni].
double PValueOf(double statistic, double looks, double scale) {
  return std::min(1.0, looks * std::exp(-0.5 * statistic / scale));
}

// By a straight line in time alone, where the column changes: at the record's begin and end.
std::pair<double, double> LineOf(const QuestionRows& rows, const Eigen::MatrixXd& group,
                                 bool constant) {
  Eigen::MatrixXd A(rows.own.rows(), rows.own.cols() + (constant ? 2 : 1));
  A << rows.own, group.leftCols(constant ? 2 : 1);
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = A * scale.asDiagonal();
  const Eigen::VectorXd step =
      -scale.cwiseProduct(scaled.completeOrthogonalDecomposition().solve(rows.residual));
  const double slope = step(A.cols() - 1);
  const double level = constant ? step(A.cols() - 2) : 0.0;
  return {level - slope, level + slope};
}

// Residuals of noise alone; rows that no series holds are of variance 1.
Eigen::VectorXd Draw(const Observations& o, const SeriesNoise& noise,
                     const Eigen::VectorXd& residual, Rng* rng) {
  Eigen::VectorXd out(residual.size());
  for (double& x : out) x = rng->Normal();
  const RowLayout layout(o);
  for (std::size_t m = 0; m < layout.series.size(); ++m) {
    const RowSeries& s = layout.series[m];
    const double step = MedianStep(*s.t);
    for (Eigen::Index axis = 0; axis < s.axes; ++axis) {
      const MarkovNoise& own = noise.series[layout.first_axis[m] + static_cast<std::size_t>(axis)];
      double state = rng->Normal();
      for (std::size_t i = 0; i < s.size(); ++i) {
        const double gap = i > 0 && step > 0.0 ? ((*s.t)[i] - (*s.t)[i - 1]) / step : 0.0;
        const double keep = own.rho > 0.0 ? std::pow(own.rho, gap) : 0.0;
        if (i > 0) state = keep * state + std::sqrt(1.0 - keep * keep) * rng->Normal();
        double& x = out(s.Row(i, axis));
        x = std::sqrt(own.variance) *
            (std::sqrt(1.0 - own.share) * x + std::sqrt(own.share) * state);
      }
    }
  }
  return (residual.array() == 0.0).select(0.0, out);
}

// The p-value where the noise is found, and not known: a parametric bootstrap by the noise that is
// found without the groups. The least of many even p-values has, in -2 log of it, Gumbel's
// distribution of scale 2; that of the draws is wider, by as much as their mean or their scatter
// is.
double Calibrated(const ConstancyInput& in, const QuestionRows& rows, const Eigen::MatrixXd& all,
                  const Taken& taken) {
  constexpr std::size_t kDraws = 24;  // give the scatter to 20%, the mean to 10%
  constexpr std::size_t kFirst = 6;   // to 40% and 20%: enough where the answer is plain
  constexpr double kPlain = 0.1;      // ten times the level
  const double scatter = 2.0 * std::numbers::pi / std::sqrt(6.0);
  const Observations& o = *in.observations;
  const SeriesNoise noise = FitSeriesNoise(o, rows.residual, rows.own);
  std::vector<double> statistics;
  const auto draw_up_to = [&](std::size_t count) {
    const std::size_t from = statistics.size();
    statistics.resize(count);
    ParallelFor(count - from, 0, [&](std::size_t i) {
      Rng rng = Rng(from + i + 1).Stream("constancy");
      QuestionRows drawn = rows, whitened;
      drawn.residual = Draw(o, noise, rows.residual, &rng);
      if (in.quantised != nullptr && in.quantised->any()) {
        in.quantised->Draw(&rng, &drawn.residual);
      }
      statistics[from + i] = Take(o, all, drawn, &whitened).statistic;
    });
    const double mean = 2.0 * (std::log(taken.looks) + std::numbers::egamma);
    const double scale =
        std::max({1.0, Mean(statistics) / mean, std::sqrt(Variance(statistics)) / scatter});
    return PValueOf(taken.statistic, taken.looks, scale);
  };
  const double first = draw_up_to(kFirst);
  return first > kPlain ? first : draw_up_to(kDraws);
}

// What is asked of some groups, and the answer.
struct Asked {
  double p_value = 1.0;
  int most = -1;          // the group that takes most
  QuestionRows whitened;  // by the noise found with all of them
};

Asked Ask(const ConstancyInput& in, const QuestionRows& rows) {
  Asked out;
  constexpr double kFewest = 2.0;  // rows to each column; fewer tell of no noise
  if (rows.groups.empty() ||
      rows.count < kFewest * static_cast<double>(rows.own.cols() + rows.added)) {
    return out;
  }
  const Eigen::MatrixXd all = rows.All();
  const Taken taken = Take(*in.observations, all, rows, &out.whitened);
  if (taken.most < 0) return out;
  out.p_value = PValueOf(taken.statistic, taken.looks, 1.0);
  const bool coarse = in.quantised != nullptr && in.quantised->any();
  if (in.calibrated_below > out.p_value && (coarse || !taken.white)) {
    out.p_value = std::max(out.p_value, Calibrated(in, rows, all, taken));
  }
  out.most = taken.most;
  return out;
}

// How much of a rival law the data want, and what the parameters then are.
void FillRival(const Asked& asked, Constancy* out) {
  const Eigen::VectorXd column = asked.whitened.groups[static_cast<std::size_t>(asked.most)].col(0);
  Eigen::MatrixXd A(asked.whitened.own.rows(), asked.whitened.own.cols() + 1);
  A << asked.whitened.own, column;
  const Eigen::VectorXd scale = A.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = A * scale.asDiagonal();
  const Eigen::VectorXd step =
      -scale.cwiseProduct(scaled.completeOrthogonalDecomposition().solve(asked.whitened.residual));
  const Eigen::Index last = A.cols() - 1;
  out->rival_part = step(last);
  const Eigen::MatrixXd basis = Beyond(Eigen::MatrixXd(A.rows(), 0), asked.whitened.own);
  const double own = (column - basis * (basis.transpose() * column)).norm();
  const double left = (asked.whitened.residual + A * step).squaredNorm();
  const double dof = std::max(1.0, asked.whitened.count - static_cast<double>(A.cols()));
  out->rival_sigma = own > 0.0 ? std::sqrt(left / dof) / own : 0.0;
  for (int j = 0; j < out->parameters; ++j) out->with_rival.push_back(step(j));
}

}  // namespace

Constancy TestConstancy(const ConstancyInput& in) {
  Constancy out;
  out.parameters = static_cast<int>(in.sensitivity.cols());
  const QuestionRows own = OwnRows(in);
  const Asked values = Ask(in, RowsOfValues(in, own));
  out.p_value = values.p_value;
  out.most = values.most;
  if (out.most >= 0) {
    const bool constant = out.most >= out.parameters;
    std::tie(out.at_begin, out.at_end) = LineOf(
        values.whitened, values.whitened.groups[static_cast<std::size_t>(out.most)], constant);
  }
  std::vector<int> index;
  const QuestionRows rivals = RowsOfRivals(in, own, &index);
  if (index.empty()) return out;
  const Asked laws = Ask(in, rivals);
  if (laws.most >= 0 && laws.p_value <= values.p_value) {
    FillRival(laws, &out);
    if (out.rival_part > 0.0) out.rival = index[static_cast<std::size_t>(laws.most)];
  }
  out.p_value = std::min(1.0, 2.0 * std::min(values.p_value, laws.p_value));
  return out;
}

}  // namespace unfurl::correlate
