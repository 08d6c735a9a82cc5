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
#include "correlate/fit/series_noise.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// A value's rise or fall along the record, and its bend; more would take more of the noise with it
// than a missing effect adds.
constexpr int kDegree = 2;
// Of a column's square, after the fit's own columns are out of it: below, it is one of them but for
// the differences that these were made by (parts in a thousand).
constexpr double kOwn = 1e-6;

// Time of each row, the record being -1 to 1; NaN: it has none.
Eigen::VectorXd TimeOfRows(const Observations& o) {
  const RowLayout layout(o);
  Eigen::VectorXd x =
      Eigen::VectorXd::Constant(layout.rows, std::numeric_limits<double>::quiet_NaN());
  const double start = o.Start(), span = std::max(1e-12, o.End() - start);
  auto place = [&](double t) { return std::clamp(2.0 * (t - start) / span - 1.0, -1.0, 1.0); };
  for (const RowSeries& s : layout.series) {
    for (std::size_t i = 0; i < s.size(); ++i) {
      x.segment(s.Row(i), s.axes).setConstant(place((*s.t)[i]));
    }
  }
  return x;
}

// P_0 .. P_2 of each row's time, 0 where it has none.
Eigen::MatrixXd Legendre(const Eigen::VectorXd& x) {
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(x.size(), kDegree + 1);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double t = x(i);
    if (std::isnan(t)) continue;
    p.row(i) << 1.0, t, 1.5 * t * t - 0.5;
  }
  return p;
}

// d residual / d offset of the record's clock.
Eigen::VectorXd ClockColumn(const ConstancyInput& in) {
  Observations free = *in.observations;
  free.placement.offset = Prior::Free();
  RegistrationOptions stay = in.registration;
  stay.max_iterations = 0;
  stay.with_others = true;
  const Eigen::Index column = WithPlacement(stay, free).fit_frame ? 6 : 0;
  return FitRegistration(free, *in.prediction, in.reference, in.at, stay)
      .jacobian.col(column)
      .head(in.residual->size());
}

// Of the motion about its mean by a part of itself.
Change SizeOf(const ConstancyInput& in) {
  Change size;
  for (const MarkMotion& m : in.prediction->marks) {
    size.marks.push_back(m.p.cols() > 0 ? (m.p.colwise() - m.p.rowwise().mean()).eval() : m.p);
  }
  for (const auto& kind : in.observations->others) {
    Eigen::VectorXd numbers = kind->NumbersOf(*in.prediction);
    const double n = static_cast<double>(numbers.array().isFinite().count());
    numbers = numbers.array().isFinite().select(numbers, 0.0);
    const double mean = numbers.sum() / std::max(1.0, n);
    numbers = kind->series().empty() ? Eigen::VectorXd::Zero(numbers.size()).eval()
                                     : (numbers.array() - mean).matrix().eval();
    size.others.push_back(std::move(numbers));
  }
  return size;
}

Eigen::MatrixXd Columns(const ConstancyInput& in, const Change& change) {
  return WhitenedSensitivity(*in.observations, *in.prediction, in.reference, in.at, {change});
}

// An orthonormal basis of what `columns` span beyond `basis`.
Eigen::MatrixXd Beyond(const Eigen::MatrixXd& basis, Eigen::MatrixXd columns) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const double norm = columns.col(c).norm();
    if (norm > 0.0) columns.col(c) /= norm;
  }
  for (int twice = 0; twice < 2; ++twice) columns -= basis * (basis.transpose() * columns);
  if (columns.cols() == 0) return columns;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns);
  qr.setThreshold(0.0);
  Eigen::Index rank = 0;
  while (rank < columns.cols() && std::abs(qr.matrixR()(rank, rank)) > std::sqrt(kOwn)) ++rank;
  return qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), rank);
}

// The fit's own columns, those of the question, and the residuals.
struct Rows {
  Eigen::MatrixXd own;  // the draw's last
  std::vector<Eigen::MatrixXd> groups;
  Eigen::VectorXd residual;
  double count = 0.0;      // that take part
  Eigen::Index added = 0;  // columns of all groups
  Eigen::Index draws = 0;

  // All columns, the draw's last.
  Eigen::MatrixXd All() const {
    Eigen::MatrixXd all(own.rows(), own.cols() + added);
    Eigen::Index at = own.cols() - draws;
    all.leftCols(at) = own.leftCols(at);
    for (const Eigen::MatrixXd& g : groups) {
      all.middleCols(at, g.cols()) = g;
      at += g.cols();
    }
    all.rightCols(draws) = own.rightCols(draws);
    return all;
  }
  void Whiten(const RowWhitening& whitening) {
    if (whitening.identity()) return;
    whitening.Apply(own);
    for (Eigen::MatrixXd& g : groups) whitening.Apply(g);
    Eigen::MatrixXd r = residual;
    whitening.Apply(r);
    residual = r.col(0);
  }
};

Rows RowsOf(const ConstancyInput& in) {
  Rows rows;
  rows.residual = *in.residual;
  rows.count = static_cast<double>((in.residual->array() != 0.0).count());
  rows.draws = in.observations->shared_rank;
  const Eigen::Index n = rows.residual.size();
  Eigen::MatrixXd known(n, 0);
  if (!in.known.empty()) known = Columns(in, in.known);
  rows.own.resize(n, in.sensitivity.cols() + known.cols() + in.jacobian->cols());
  rows.own << in.sensitivity, known, *in.jacobian;
  const Eigen::MatrixXd p = Legendre(TimeOfRows(*in.observations));
  auto add = [&](const Eigen::VectorXd& column, int from, int to) {
    rows.groups.emplace_back(p.middleCols(from, to - from + 1).array().colwise() * column.array());
    rows.added += rows.groups.back().cols();
  };
  // As many as leave ten rows to each.
  const auto groups = static_cast<double>(in.sensitivity.cols() + 2);
  const int degree = std::clamp(static_cast<int>(rows.count / (10.0 * groups)), 1, kDegree);
  for (Eigen::Index j = 0; j < in.sensitivity.cols(); ++j) add(in.sensitivity.col(j), 1, degree);
  add(ClockColumn(in), 0, 1);
  add(Columns(in, SizeOf(in)).col(0), 0, 1);
  return rows;
}

// What the groups take of the residuals, all together and each alone.
struct Taken {
  // Of the looks, -2 log of the least p-value [-]; their number.
  double statistic = 0.0, looks = 0.0;
  int most = -1;  // the group that takes most
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
Left LeftBy(const RowWhitening& whitening, Rows* rows) {
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
    out.alone.push_back(out.without - (own.transpose() * r).squaredNorm());
    out.alone_freedoms.push_back(static_cast<double>(own.cols()));
  }
  const Eigen::MatrixXd space = Beyond(basis, std::move(every));
  out.fitted = static_cast<double>(basis.cols());
  out.freedoms = static_cast<double>(space.cols());
  out.with = out.without - (space.transpose() * r).squaredNorm();
  return out;
}

// `whitened`: the rows by the noise found with all columns.
Taken Take(const Observations& o, const Eigen::MatrixXd& all, const Rows& rows, Rows* whitened) {
  *whitened = rows;
  Rows plain = rows;
  const Left with = LeftBy(RowWhitening(o, FitSeriesNoise(o, rows.residual, all)), whitened);
  const Left without = LeftBy(RowWhitening(o, FitSeriesNoise(o, rows.residual, rows.own)), &plain);
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
  double least = chance(best(with.with, without.with) - fit, with.freedoms);
  double least_alone = 1.0;
  out.looks = 1.0;
  for (std::size_t g = 0; g < with.alone.size(); ++g) {
    if (with.alone_freedoms[g] == 0.0) continue;
    out.looks += 1.0;
    const double p = chance(best(with.alone[g], without.alone[g]) - fit, with.alone_freedoms[g]);
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
std::pair<double, double> LineOf(const Rows& rows, const Eigen::MatrixXd& group, bool constant) {
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
double Calibrated(const ConstancyInput& in, const Rows& rows, const Eigen::MatrixXd& all,
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
      Rows drawn = rows, whitened;
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

}  // namespace

Constancy TestConstancy(const ConstancyInput& in) {
  Constancy out;
  out.parameters = static_cast<int>(in.sensitivity.cols());
  const Rows rows = RowsOf(in);
  constexpr double kFewest = 2.0;  // rows to each column; fewer tell of no noise
  if (rows.count < kFewest * static_cast<double>(rows.own.cols() + rows.added)) return out;
  const Eigen::MatrixXd all = rows.All();
  Rows whitened;
  const Taken taken = Take(*in.observations, all, rows, &whitened);
  if (taken.most < 0) return out;
  out.p_value = PValueOf(taken.statistic, taken.looks, 1.0);
  if (in.calibrated_below > out.p_value) {
    out.p_value = std::max(out.p_value, Calibrated(in, rows, all, taken));
  }
  out.most = taken.most;
  const bool constant = out.most >= out.parameters;
  std::tie(out.at_begin, out.at_end) =
      LineOf(whitened, whitened.groups[static_cast<std::size_t>(out.most)], constant);
  return out;
}

}  // namespace unfurl::correlate
