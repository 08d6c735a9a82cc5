#include "correlate/fit/noise_doubt.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "base/dense.h"
#include "base/worker_pool.h"
#include "correlate/fit/noise_contrasts.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// Of the lattice over logit of the share and logarithm of the correlation time. A record of N
// correlation times tells the latter to sqrt(2 / N): where a step is more than that there is next
// to nothing to average over.
constexpr double kShareStep = 1.5, kTimeStep = 0.4;
constexpr double kLeastShare = -5.0;   // logit: of a hundredth of the noise nothing is seen
constexpr double kFarthest = 6.0;      // of the log-likelihood below its maximum: 1 in 400
constexpr double kLeastWeight = 1e-3;  // [-]: twenty of them together are a fiftieth

double Logit(double x) { return std::log(x / (1.0 - x)); }
double Share(double logit) { return 1.0 / (1.0 + std::exp(-logit)); }

// The lattice's points about the estimate, as far as the likelihood goes.
class Lattice {
 public:
  Lattice(const std::vector<NoiseContrasts>& all, const std::vector<std::size_t>& members,
          const MarkovNoise& estimate, double length)
      : all_(all),
        members_(members),
        share_(Logit(std::clamp(estimate.share, 1e-3, kLargestShare))),
        time_(-std::log(1.0 - estimate.rho)),
        longest_(-std::log(1.0 - LargestRho(length))) {
    for (std::size_t s : members_) dof_ += all_[s].dof();
  }

  std::vector<LikelyNoise> Points() {
    std::vector<std::pair<int, int>> next = {{0, 0}};
    while (!next.empty()) {
      const auto [i, j] = next.back();
      next.pop_back();
      if (seen_.contains({i, j}) || !Inside(i, j)) continue;
      const Seen& here = seen_[{i, j}] = At(i, j);
      most_ = std::max(most_, here.log_likelihood);
      if (here.log_likelihood < most_ - kFarthest) continue;
      for (const auto& [di, dj] :
           {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}}) {
        next.emplace_back(i + di, j + dj);
      }
    }
    double total = 0.0;
    for (const auto& [at, seen] : seen_) total += std::exp(seen.log_likelihood - most_);
    std::vector<LikelyNoise> out;
    for (const auto& [at, seen] : seen_) {
      const double weight = std::exp(seen.log_likelihood - most_) / total;
      if (weight > kLeastWeight) out.push_back({seen.noise, weight});
    }
    return out;
  }

 private:
  struct Seen {
    MarkovNoise noise;
    double log_likelihood = 0.0;
  };

  double ShareAt(int i) const { return share_ + kShareStep * i; }
  double TimeAt(int j) const { return time_ + kTimeStep * j; }
  bool Inside(int i, int j) const {
    const bool estimate = i == 0 && j == 0;
    return estimate || (ShareAt(i) >= kLeastShare && ShareAt(i) <= Logit(kLargestShare) &&
                        TimeAt(j) > 0.0 && TimeAt(j) <= longest_);
  }
  Seen At(int i, int j) const {
    Seen out;
    out.noise = {1.0, Share(ShareAt(i)), 1.0 - std::exp(-TimeAt(j))};
    NoisePieces sum;
    for (std::size_t s : members_) {
      const NoisePieces one = PiecesOf(all_[s], out.noise);
      sum.squares += one.squares;
      sum.logdet += one.logdet;
    }
    double variance = 1.0;
    out.log_likelihood = RestrictedLogLikelihood(sum, dof_, &variance);
    out.noise.variance = variance;
    return out;
  }

  const std::vector<NoiseContrasts>& all_;
  const std::vector<std::size_t>& members_;
  double share_, time_, longest_;
  double dof_ = 0.0;
  double most_ = -1e300;
  std::map<std::pair<int, int>, Seen> seen_;
};

Pooling PoolingOf(const std::string& name) {
  for (const Pooling pooling : {Pooling::kAll, Pooling::kByMark}) {
    if (name == Name(pooling)) return pooling;
  }
  return Pooling::kNone;
}

// Rows of each series and axis, in the order of SeriesNoise::series.
std::vector<std::vector<Eigen::Index>> RowsByAxis(const Observations& observations) {
  std::vector<std::vector<Eigen::Index>> out;
  for (const RowSeries& series : RowLayout(observations).series) {
    for (Eigen::Index axis = 0; axis < series.axes; ++axis) {
      out.emplace_back();
      for (std::size_t i = 0; i < series.size(); ++i) out.back().push_back(series.Row(i, axis));
    }
  }
  return out;
}

// The part of a symmetric matrix that adds.
Eigen::MatrixXd Positive(const Eigen::MatrixXd& sum, const Eigen::MatrixXd& unit) {
  const Eigen::VectorXd scale = unit.diagonal().cwiseMax(1e-300).cwiseSqrt();
  const Eigen::VectorXd inverse = scale.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(inverse.asDiagonal() * sum * inverse.asDiagonal()));
  const Eigen::MatrixXd V = scale.asDiagonal() * eigen.eigenvectors();
  return V * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
}

}  // namespace

std::vector<NoiseGroup> LikelyNoises(const Observations& observations,
                                     const Eigen::VectorXd& residual, const Eigen::MatrixXd& A,
                                     const SeriesNoise& found) {
  const std::vector<NoiseContrasts> all = ContrastsOf(observations, residual, A);
  double length = 1.0;  // of the longest series [samples]
  for (const NoiseContrasts& s : all) {
    double own = 0.0;
    for (const double gap : s.gap) own += gap;
    length = std::max(length, own);
  }
  std::vector<NoiseGroup> out;
  for (std::vector<std::size_t>& members : GroupsOf(all, PoolingOf(found.pooled))) {
    const MarkovNoise& estimate = found.series[members.front()];
    if (estimate.white()) continue;
    std::vector<LikelyNoise> likely = Lattice(all, members, estimate, length).Points();
    out.push_back({std::move(members), std::move(likely)});
  }
  return out;
}

void NoiseDoubtInput::TakeRows(const StackedRows& all, std::size_t trial, Eigen::Index parameters) {
  const StackedRows::Block& b = all.blocks[trial];
  rows.resize(b.rows, parameters + b.columns);
  rows << all.A.block(b.row, 0, b.rows, parameters),
      all.A.block(b.row, b.column, b.rows, b.columns);
  place.clear();
  for (Eigen::Index i = 0; i < parameters; ++i) place.push_back(i);
  for (Eigen::Index i = 0; i < b.columns; ++i) place.push_back(b.column + i);
}

Eigen::MatrixXd DoubtOfNoise(const NoiseDoubtInput& in) {
  const Eigen::Index n = in.normal->rows(), own = in.rows.cols();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, n);
  // Rows and residuals side by side, whitened by a noise, are all that an estimate needs.
  Eigen::MatrixXd plain(in.rows.rows(), own + 1);
  plain << in.rows, *in.residual;
  const auto gram = [&](const SeriesNoise& noise, const std::vector<Eigen::Index>& of) {
    Eigen::MatrixXd rows = plain;
    const RowWhitening whitening(*in.observations, noise);
    if (!whitening.identity()) whitening.Apply(rows);
    return Gram(rows(of, Eigen::all));
  };
  const std::vector<std::vector<Eigen::Index>> places = RowsByAxis(*in.observations);
  for (const NoiseGroup& group : LikelyNoises(*in.observations, *in.residual, in.rows, *in.noise)) {
    // Nothing changes in the rows of the others, which are left as they are.
    SeriesNoise other = *in.noise;
    other.series.assign(other.series.size(), {});
    std::vector<Eigen::Index> of;
    for (std::size_t s : group.series) {
      other.series[s] = in.noise->series[s];
      of.insert(of.end(), places[s].begin(), places[s].end());
    }
    const Eigen::MatrixXd found = gram(other, of);
    // Each by itself, on all cores; added in their order, so that the sum is the same on any
    // number.
    std::vector<Eigen::MatrixXd> adds(group.likely.size());
    ParallelFor(group.likely.size(), 0, [&](std::size_t i) {
      const LikelyNoise& one = group.likely[i];
      SeriesNoise its = other;
      for (std::size_t s : group.series) its.series[s] = one.noise;
      const Eigen::MatrixXd change = gram(its, of) - found;
      Eigen::MatrixXd normal = *in.normal, open;
      normal(in.place, in.place) += change.topLeftCorner(own, own);
      Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);  // 0 by the noise found
      gradient(in.place) = change.col(own).head(own);
      const Eigen::MatrixXd covariance = InverseOfNormal(normal, &open);
      const Eigen::VectorXd shift = covariance * gradient;
      adds[i] = one.weight * (covariance - *in.covariance + shift * shift.transpose());
    });
    for (const Eigen::MatrixXd& one : adds) sum += one;
  }
  return Positive(sum, *in.covariance);
}

}  // namespace unfurl::correlate
