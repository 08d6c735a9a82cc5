#include "correlate/modes/lag_covariances.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

// Signals that tell most: pivoted Cholesky of their covariance.
std::vector<Eigen::Index> ChooseReferences(const JointSignals& joint, Eigen::Index most) {
  const Eigen::Index l = joint.stretches.front().value.rows();
  Eigen::MatrixXd rest = Eigen::MatrixXd::Zero(l, l);
  for (const auto& s : joint.stretches) rest += s.value * s.value.transpose();
  std::vector<Eigen::Index> out;
  const double whole = rest.trace();
  constexpr double kNothing = 1e-10;  // of all: what is left is round-off
  while (static_cast<Eigen::Index>(out.size()) < std::min(most, l)) {
    Eigen::Index best = 0;
    const double left = rest.diagonal().maxCoeff(&best);
    if (!(left > kNothing * whole)) break;
    out.push_back(best);
    const Eigen::VectorXd column = rest.col(best) / std::sqrt(left);
    rest -= column * column.transpose();
  }
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

LagCovariances Covariances(const JointSignals& joint, Eigen::Index lags, Eigen::Index references,
                           Eigen::Index count) {
  LagCovariances out;
  out.lags = lags;
  if (joint.stretches.empty()) return out;
  out.references = ChooseReferences(joint, references);
  const Eigen::Index l = joint.stretches.front().value.rows();
  const auto r = static_cast<Eigen::Index>(out.references.size());
  // Pairs of samples begin at an instant; blocks are of as many of these each.
  Eigen::Index beginnings = 0;
  for (const auto& s : joint.stretches) {
    beginnings += std::max<Eigen::Index>(0, s.value.cols() - lags);
  }
  const Eigen::Index n = r == 0 ? 0 : std::min(count, beginnings / std::max<Eigen::Index>(1, lags));
  out.blocks = Eigen::MatrixXd::Zero(l * r * (lags + 1), n);
  if (n < 2) return out;
  const Eigen::Index length = beginnings / n;  // the last few instants take no part
  out.block_seconds = joint.step * static_cast<double>(length);
  Eigen::Index done = 0;
  for (const auto& s : joint.stretches) {
    const Eigen::Index all = s.value.cols() - lags;
    for (Eigen::Index from = 0; from < all && done < n * length;) {
      const Eigen::Index block = done / length;
      const Eigen::Index take = std::min(all - from, (block + 1) * length - done);
      Eigen::MatrixXd reference(r, take);
      for (Eigen::Index j = 0; j < r; ++j) {
        reference.row(j) =
            s.value.row(out.references[static_cast<std::size_t>(j)]).segment(from, take);
      }
      for (Eigen::Index k = 0; k <= lags; ++k) {
        Eigen::Map<Eigen::MatrixXd> R(out.blocks.col(block).data() + k * l * r, l, r);
        R.noalias() += s.value.middleCols(from + k, take) * reference.transpose();
      }
      from += take;
      done += take;
    }
  }
  out.blocks /= static_cast<double>(length);
  out.mean = out.blocks.rowwise().mean();
  out.blocks.colwise() -= out.mean.col(0);
  return out;
}

Eigen::VectorXd Grouped(const Eigen::VectorXd& blocks, double block_seconds, double memory) {
  constexpr double kMemories = 4.0;     // means of so many are all but independent [-]
  constexpr Eigen::Index kFewest = 20;  // of whose scatter a standard error is known to a sixth [-]
  const double wanted = std::ceil(kMemories * memory / block_seconds);
  const Eigen::Index most = std::max<Eigen::Index>(1, blocks.size() / kFewest);
  const auto each = static_cast<Eigen::Index>(std::clamp(wanted, 1.0, static_cast<double>(most)));
  Eigen::VectorXd mean(blocks.size() / each);
  for (Eigen::Index g = 0; g < mean.size(); ++g) mean(g) = blocks.segment(g * each, each).mean();
  return mean;
}

double BlockSigma(const Eigen::VectorXd& blocks, double block_seconds, double memory) {
  if (blocks.size() < 2) return 0.0;
  const Eigen::VectorXd mean = Grouped(blocks, block_seconds, memory);
  const auto n = static_cast<double>(mean.size());
  const double variance = (mean.array() - mean.mean()).square().sum() / (n - 1.0);
  return std::sqrt(variance / n) * StudentQuantile(0.975, n - 1.0) / NormalQuantile(0.975);
}

}  // namespace unfurl::correlate
