#include "correlate/fit/series_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "base/dense.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

// The longest correlation time, in lengths of the longest series: over one of these such noise
// moves by less than half its standard deviation, sqrt(2 / kLongest). Slower noise is, to a record,
// a constant and a random walk, whose rate the variance takes up.
constexpr double kLongest = 10.0;
// Shares at and beyond this leave a little white noise, without which a row that repeats the one
// before would be known for certain.
constexpr double kLargestShare = 0.9999;

// One step of the filter for noise of variance 1.
struct FilterStep {
  double decay = 0.0, gain = 0.0, innovation = 1.0;  // of the prediction; Kalman; variance
};

// `gap` in samples; 0: the first. `left` is the state's variance after the row before.
FilterStep Step(const MarkovNoise& noise, double gap, double* left) {
  FilterStep step;
  const double share = std::min(noise.share, kLargestShare);
  step.decay = gap > 0.0 ? std::pow(noise.rho, gap) : 0.0;
  const double before = step.decay * step.decay * *left + share * (1.0 - step.decay * step.decay);
  step.innovation = before + 1.0 - share;
  step.gain = before / step.innovation;
  *left = (1.0 - step.gain) * before;
  return step;
}

// One series: its residuals first, then an orthonormal basis of its columns of A.
struct Series {
  Eigen::MatrixXd rows;     // n x (1 + r)
  std::vector<double> gap;  // n, in samples; first 0
  std::size_t mark = 0;
  double dof() const { return static_cast<double>(rows.rows() - rows.cols() + 1); }
};

// What one series adds to the restricted likelihood of noise of unit variance.
struct Pieces {
  double squares = 0.0;  // of the contrasts, whitened
  double logdet = 0.0;
};

Pieces Evaluate(const Series& s, const MarkovNoise& noise) {
  const Eigen::Index n = s.rows.rows(), q = s.rows.cols();
  Pieces out;
  Eigen::MatrixXd white = s.rows;
  if (!noise.white()) {
    std::vector<FilterStep> steps(static_cast<std::size_t>(n));
    double left = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      FilterStep& step = steps[static_cast<std::size_t>(i)];
      step = Step(noise, s.gap[static_cast<std::size_t>(i)], &left);
      out.logdet += std::log(step.innovation);
    }
    for (Eigen::Index c = 0; c < q; ++c) {
      double state = 0.0;
      for (Eigen::Index i = 0; i < n; ++i) {
        const FilterStep& step = steps[static_cast<std::size_t>(i)];
        state *= step.decay;
        const double innovation = white(i, c) - state;
        state += step.gain * innovation;
        white(i, c) = innovation / std::sqrt(step.innovation);
      }
    }
  }
  out.squares = white.col(0).squaredNorm();
  if (q == 1) return out;
  const auto columns = white.rightCols(q - 1);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(q - 1, q - 1);
  normal.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> llt(normal.selfadjointView<Eigen::Lower>());
  const Eigen::VectorXd right = columns.transpose() * white.col(0);
  out.squares -= right.dot(llt.solve(right));
  for (Eigen::Index i = 0; i < q - 1; ++i) out.logdet += 2.0 * std::log(llt.matrixL()(i, i));
  out.squares = std::max(out.squares, 0.0);
  return out;
}

// An orthonormal basis of what the unknowns can do to a series: all that the free ones can, of any
// unit; of the calibration's directions, whose draws have variance 1, what they are felt by. Where
// a mark hardly moves these differ by next to nothing, and the rest of them is the samples' own
// scatter, at which they were evaluated: taking that out would take the noise out of the residuals.
Eigen::MatrixXd Touched(const Eigen::MatrixXd& free, const Eigen::MatrixXd& limited) {
  constexpr double kFelt = 3.0;  // norm over the series, in its samples' sigmas
  const Eigen::Index n = free.rows();
  const Eigen::VectorXd scale = free.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(free * scale.asDiagonal());
  qr.setThreshold(1e-7);
  const Eigen::Index rank = n > 0 ? qr.rank() : 0;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(n, rank);
  if (n == 0) return basis;
  basis = qr.householderQ() * Eigen::MatrixXd::Identity(n, rank);
  if (limited.cols() == 0) return basis;
  Eigen::MatrixXd rest = limited;
  for (int twice = 0; twice < 2; ++twice) rest -= basis * (basis.transpose() * rest);
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(rest, Eigen::ComputeThinU);
  Eigen::Index felt = 0;
  while (felt < svd.singularValues().size() && svd.singularValues()(felt) > kFelt) ++felt;
  Eigen::MatrixXd both(n, rank + felt);
  both << basis, svd.matrixU().leftCols(felt);
  return both;
}

std::vector<Series> Split(const Observations& o, const Eigen::VectorXd& residual,
                          const Eigen::MatrixXd& A) {
  std::vector<Series> all;
  const Eigen::Index free = A.cols() - o.shared_rank;
  const RowLayout layout(o);
  for (std::size_t m = 0; m < layout.series.size(); ++m) {
    const RowSeries& mark = layout.series[m];
    const std::vector<double>& t = *mark.t;
    const double step = MedianStep(t);
    std::vector<Eigen::Index> row;
    std::vector<double> gap;
    for (std::size_t i = 0, last = 0; i < mark.size(); ++i) {
      if (!mark.Known(residual, i)) continue;
      gap.push_back(row.empty() || step <= 0.0 ? 0.0 : (t[i] - t[last]) / step);
      row.push_back(mark.Row(i));
      last = i;
    }
    const auto n = static_cast<Eigen::Index>(row.size());
    for (Eigen::Index axis = 0; axis < mark.axes; ++axis) {
      Series s;
      s.mark = m;
      s.gap = gap;
      Eigen::VectorXd y(n);
      Eigen::MatrixXd X(n, A.cols());
      for (Eigen::Index i = 0; i < n; ++i) {
        y(i) = residual(row[static_cast<std::size_t>(i)] + axis);
        X.row(i) = A.row(row[static_cast<std::size_t>(i)] + axis);
      }
      const Eigen::MatrixXd basis = Touched(X.leftCols(free), X.rightCols(o.shared_rank));
      s.rows.resize(n, 1 + basis.cols());
      s.rows.col(0) = y;
      s.rows.rightCols(basis.cols()) = basis;
      all.push_back(std::move(s));
    }
  }
  return all;
}

// The restricted log-likelihood of a group at its best variance.
double LogLikelihood(double squares, double logdet, double dof, double* variance) {
  *variance = squares / dof;
  if (!(*variance > 0.0)) return -std::numeric_limits<double>::infinity();
  return -0.5 * (dof * std::log(*variance) + logdet + dof);
}

struct GroupFit {
  MarkovNoise noise;
  double log_likelihood = 0.0;
  double parameters = 0.0;
};

class Group {
 public:
  Group(const std::vector<Series>& all, std::vector<std::size_t> members, double largest_rho)
      : all_(all), members_(std::move(members)), largest_rho_(largest_rho) {
    for (std::size_t s : members_) dof_ += all_[s].dof();
  }

  double dof() const { return dof_; }

  double At(double share, double rho, double* variance) const {
    const MarkovNoise noise{1.0, share, rho};
    Pieces sum;
    for (std::size_t s : members_) {
      const Pieces one = Evaluate(all_[s], noise);
      sum.squares += one.squares;
      sum.logdet += one.logdet;
    }
    return LogLikelihood(sum.squares, sum.logdet, dof_, variance);
  }

  // White of variance 1, white, or correlated, by the information criterion over `penalty` per
  // parameter.
  GroupFit Fit(const std::vector<std::vector<Pieces>>& table,
               const std::vector<std::pair<double, double>>& grid, double penalty) const {
    GroupFit best;
    Pieces white;
    for (std::size_t s : members_) {
      white.squares += table[s][0].squares;
      white.logdet += table[s][0].logdet;
    }
    best.log_likelihood = -0.5 * (white.squares + white.logdet);  // of variance 1
    double variance = 1.0;
    const double own = LogLikelihood(white.squares, white.logdet, dof_, &variance);
    auto score = [&](double l, double parameters) { return 2.0 * l - penalty * parameters; };
    if (variance > 1.0 && score(own, 1.0) > score(best.log_likelihood, 0.0)) {
      best = {{variance, 0.0, 0.0}, own, 1.0};
    }
    double share = 0.0, rho = 0.0, l = -std::numeric_limits<double>::infinity();
    for (std::size_t g = 1; g < grid.size(); ++g) {
      Pieces sum;
      for (std::size_t s : members_) {
        sum.squares += table[s][g].squares;
        sum.logdet += table[s][g].logdet;
      }
      double v;
      const double here = LogLikelihood(sum.squares, sum.logdet, dof_, &v);
      if (here > l) l = here, share = grid[g].first, rho = grid[g].second;
    }
    if (score(l, 3.0) + kRefineGain < score(best.log_likelihood, best.parameters)) return best;
    Refine(&share, &rho, &l, &variance);
    if (score(l, 3.0) > score(best.log_likelihood, best.parameters)) {
      best = {{variance, share, rho}, l, 3.0};
    }
    return best;
  }

 private:
  static constexpr double kRefineGain = 10.0;  // more than the grid can be off by

  // Compass search in logits, which give both ends of either range room; along the diagonal, too,
  // where the rate at which slow noise walks off, over the white part, stays as it is.
  void Refine(double* share, double* rho, double* l, double* variance) const {
    auto logit = [](double x) { return std::log(x / (1.0 - x)); };
    auto inverse = [](double u) { return 1.0 / (1.0 + std::exp(-u)); };
    double a = logit(std::clamp(*share, 1e-3, kLargestShare)), b = logit(*rho);
    *l = At(inverse(a), inverse(b), variance);
    for (double step = 0.5; step > 0.02;) {
      bool moved = false;
      for (const auto& [da, db] : std::array<std::pair<double, double>, 6>{
               {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}}}) {
        const double ta = std::clamp(a + step * da, -7.0, logit(kLargestShare));
        const double tb = std::clamp(b + step * db, -3.0, logit(largest_rho_));
        double v;
        const double here = At(inverse(ta), inverse(tb), &v);
        if (here > *l + 1e-9) {
          *l = here, a = ta, b = tb, *variance = v;
          moved = true;
          break;
        }
      }
      if (!moved) step *= 0.5;
    }
    *share = inverse(a);
    *rho = inverse(b);
  }

  const std::vector<Series>& all_;
  std::vector<std::size_t> members_;
  double largest_rho_ = 0.0;
  double dof_ = 0.0;
};

// Of series of this length [samples].
double LargestRho(double length) { return 1.0 - 1.0 / (kLongest * length); }

// Shares and correlations at which every series is looked at, white noise first. Correlation times
// double and more from one sample to the length of the longest series [samples].
std::vector<std::pair<double, double>> ShareAndRho(double length) {
  std::vector<double> rhos = {0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.996, 0.9985};
  constexpr double kRatio = 2.5;  // of the last ones above
  double time = kRatio / (1.0 - rhos.back());
  while (time < length) {
    rhos.push_back(1.0 - 1.0 / time);
    time *= kRatio;
  }
  std::erase_if(rhos, [&](double rho) { return rho > LargestRho(length); });
  std::vector<std::pair<double, double>> grid = {{0.0, 0.0}};
  for (double share : {0.05, 0.2, 0.5, 0.8, 0.95, kLargestShare}) {
    for (double rho : rhos) grid.emplace_back(share, rho);
  }
  return grid;
}

// What shares one noise: all series, those of each mark, or each series alone.
enum class Pooling { kAll, kByMark, kNone };

std::vector<std::vector<std::size_t>> GroupsOf(const std::vector<Series>& all,
                                               const std::vector<std::size_t>& useful,
                                               Pooling pooling) {
  std::vector<std::vector<std::size_t>> groups;
  for (std::size_t s : useful) {
    const bool together =
        !groups.empty() &&
        (pooling == Pooling::kAll ||
         (pooling == Pooling::kByMark && all[groups.back().back()].mark == all[s].mark));
    if (!together) groups.emplace_back();
    groups.back().push_back(s);
  }
  return groups;
}

}  // namespace

bool SeriesNoise::white() const {
  return std::all_of(series.begin(), series.end(),
                     [](const MarkovNoise& n) { return n.white() && n.variance == 1.0; });
}

SeriesNoise FitSeriesNoise(const Observations& observations, const Eigen::VectorXd& residual,
                           const Eigen::MatrixXd& A) {
  std::vector<Series> all = Split(observations, residual, A);
  std::vector<std::size_t> useful;
  constexpr double kFewest = 20.0;  // contrasts; fewer tell nothing of correlation
  double length = 0.0;              // of the longest series [samples]
  for (std::size_t s = 0; s < all.size(); ++s) {
    if (all[s].dof() < kFewest) continue;
    useful.push_back(s);
    length = std::max(length, std::accumulate(all[s].gap.begin(), all[s].gap.end(), 0.0));
  }
  SeriesNoise out;
  out.series.resize(all.size());
  out.pooled = "all series";
  if (useful.empty()) return out;

  const std::vector<std::pair<double, double>> grid = ShareAndRho(length);
  std::vector<std::vector<Pieces>> table(all.size());
  double dof = 0.0, white = 0.0;
  for (std::size_t s : useful) {
    for (const auto& [share, rho] : grid) {
      table[s].push_back(Evaluate(all[s], {1.0, share, rho}));
    }
    dof += all[s].dof();
    white -= 0.5 * (table[s][0].squares + table[s][0].logdet);
  }
  const double penalty = std::log(dof), largest_rho = LargestRho(length);
  double best = -std::numeric_limits<double>::infinity();
  for (const auto& [pooling, name] :
       {std::pair{Pooling::kAll, "all series"}, std::pair{Pooling::kByMark, "each mark"},
        std::pair{Pooling::kNone, "each series"}}) {
    SeriesNoise candidate;
    candidate.series.resize(all.size());
    candidate.pooled = name;
    double likelihood = 0.0, parameters = 0.0;
    for (const std::vector<std::size_t>& members : GroupsOf(all, useful, pooling)) {
      const GroupFit fit = Group(all, members, largest_rho).Fit(table, grid, penalty);
      likelihood += fit.log_likelihood;
      parameters += fit.parameters;
      for (std::size_t s : members) candidate.series[s] = fit.noise;
    }
    candidate.gain = 2.0 * (likelihood - white);
    const double score = 2.0 * likelihood - penalty * parameters;
    if (score > best) {
      best = score;
      out = std::move(candidate);
    }
  }
  return out;
}

RowWhitening::RowWhitening(const Observations& observations, const SeriesNoise& noise) {
  if (noise.white()) return;
  const RowLayout layout(observations);
  for (std::size_t m = 0; m < layout.series.size(); ++m) {
    const RowSeries& mark = layout.series[m];
    const std::vector<double>& t = *mark.t;
    const double step = MedianStep(t);
    std::array<double, 3> left = {};
    parts_.push_back({mark.first, mark.axes * static_cast<Eigen::Index>(mark.size()), mark.axes,
                      inverse_sd_.size()});
    for (std::size_t i = 0; i < mark.size(); ++i) {
      const double gap = i > 0 && step > 0.0 ? (t[i] - t[i - 1]) / step : 0.0;
      for (std::size_t axis = 0; axis < static_cast<std::size_t>(mark.axes); ++axis) {
        const MarkovNoise& own = noise.series[layout.first_axis[m] + axis];
        FilterStep s;
        if (!own.white()) s = Step(own, gap, &left[axis]);
        decay_.push_back(s.decay);
        gain_.push_back(s.gain);
        inverse_sd_.push_back(1.0 / std::sqrt(own.variance * s.innovation));
      }
    }
  }
}

void RowWhitening::Apply(Eigen::Ref<Eigen::MatrixXd> rows) const {
  for (Eigen::Index c = 0; c < rows.cols(); ++c) {
    for (const Part& part : parts_) {
      std::array<double, 3> state = {};
      Eigen::Index axis = 0;
      for (Eigen::Index i = 0; i < part.rows; ++i) {
        const std::size_t k = part.at + static_cast<std::size_t>(i);
        double& x = state[static_cast<std::size_t>(axis)];
        if (++axis == part.axes) axis = 0;
        x *= decay_[k];
        double& value = rows(part.first + i, c);
        const double innovation = value - x;
        x += gain_[k] * innovation;
        value = innovation * inverse_sd_[k];
      }
    }
  }
}

}  // namespace unfurl::correlate
