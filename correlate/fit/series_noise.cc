#include "correlate/fit/series_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "correlate/fit/noise_contrasts.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

struct GroupFit {
  MarkovNoise noise;
  double log_likelihood = 0.0;
  double parameters = 0.0;
};

class Group {
 public:
  Group(const std::vector<NoiseContrasts>& all, std::vector<std::size_t> members,
        double largest_rho)
      : all_(all), members_(std::move(members)), largest_rho_(largest_rho) {
    for (std::size_t s : members_) dof_ += all_[s].dof();
  }

  double dof() const { return dof_; }

  double At(double share, double rho, double* variance) const {
    const MarkovNoise noise{1.0, share, rho};
    NoisePieces sum;
    for (std::size_t s : members_) {
      const NoisePieces one = PiecesOf(all_[s], noise);
      sum.squares += one.squares;
      sum.logdet += one.logdet;
    }
    return RestrictedLogLikelihood(sum, dof_, variance);
  }

  // White of variance 1, white, or correlated, by the information criterion over `penalty` per
  // parameter.
  GroupFit Fit(const std::vector<std::vector<NoisePieces>>& table,
               const std::vector<std::pair<double, double>>& grid, double penalty) const {
    GroupFit best;
    NoisePieces white;
    for (std::size_t s : members_) {
      white.squares += table[s][0].squares;
      white.logdet += table[s][0].logdet;
    }
    best.log_likelihood = -0.5 * (white.squares + white.logdet);  // of variance 1
    double variance = 1.0;
    const double own = RestrictedLogLikelihood(white, dof_, &variance);
    auto score = [&](double l, double parameters) { return 2.0 * l - penalty * parameters; };
    if (variance > 1.0 && score(own, 1.0) > score(best.log_likelihood, 0.0)) {
      best = {{variance, 0.0, 0.0}, own, 1.0};
    }
    double share = 0.0, rho = 0.0, l = -std::numeric_limits<double>::infinity();
    for (std::size_t g = 1; g < grid.size(); ++g) {
      NoisePieces sum;
      for (std::size_t s : members_) {
        sum.squares += table[s][g].squares;
        sum.logdet += table[s][g].logdet;
      }
      double v;
      const double here = RestrictedLogLikelihood(sum, dof_, &v);
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

  const std::vector<NoiseContrasts>& all_;
  std::vector<std::size_t> members_;
  double largest_rho_ = 0.0;
  double dof_ = 0.0;
};

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

}  // namespace

bool SeriesNoise::white() const {
  return std::all_of(series.begin(), series.end(),
                     [](const MarkovNoise& n) { return n.white() && n.variance == 1.0; });
}

SeriesNoise FitSeriesNoise(const Observations& observations, const Eigen::VectorXd& residual,
                           const Eigen::MatrixXd& A) {
  const std::vector<NoiseContrasts> all = ContrastsOf(observations, residual, A);
  std::vector<std::size_t> useful;
  double length = 0.0;  // of the longest series [samples]
  for (const std::vector<std::size_t>& one : GroupsOf(all, Pooling::kNone)) {
    const std::size_t s = one.front();
    useful.push_back(s);
    length = std::max(length, std::accumulate(all[s].gap.begin(), all[s].gap.end(), 0.0));
  }
  SeriesNoise out;
  out.series.resize(all.size());
  out.pooled = Name(Pooling::kAll);
  if (useful.empty()) return out;

  const std::vector<std::pair<double, double>> grid = ShareAndRho(length);
  std::vector<std::vector<NoisePieces>> table(all.size());
  double dof = 0.0, white = 0.0;
  for (std::size_t s : useful) {
    for (const auto& [share, rho] : grid) {
      table[s].push_back(PiecesOf(all[s], {1.0, share, rho}));
    }
    dof += all[s].dof();
    white -= 0.5 * (table[s][0].squares + table[s][0].logdet);
  }
  const double penalty = std::log(dof), largest_rho = LargestRho(length);
  double best = -std::numeric_limits<double>::infinity();
  for (const Pooling pooling : {Pooling::kAll, Pooling::kByMark, Pooling::kNone}) {
    SeriesNoise candidate;
    candidate.series.resize(all.size());
    candidate.pooled = Name(pooling);
    double likelihood = 0.0, parameters = 0.0;
    for (const std::vector<std::size_t>& members : GroupsOf(all, pooling)) {
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
    for (std::size_t i = 0, last = mark.size(); i < mark.size(); ++i) {
      if (mark.aside != nullptr && (*mark.aside)[i]) {  // it tells nothing of the noise beside it
        for (Eigen::Index axis = 0; axis < mark.axes; ++axis) {
          decay_.push_back(1.0), gain_.push_back(0.0), inverse_sd_.push_back(0.0);
        }
        continue;
      }
      const double gap = last < i && step > 0.0 ? (t[i] - t[last]) / step : 0.0;
      last = i;
      for (std::size_t axis = 0; axis < static_cast<std::size_t>(mark.axes); ++axis) {
        const MarkovNoise& own = noise.series[layout.first_axis[m] + axis];
        FilterStep s;
        if (!own.white()) s = StepOfFilter(own, gap, &left[axis]);
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
