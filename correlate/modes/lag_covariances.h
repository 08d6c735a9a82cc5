#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/modes/joint_grid.h"

namespace unfurl::correlate {

/// Sample covariances of l signals with r of them as references, R_k = mean of y(t + k) y_ref(t)^T
/// for lags k = 0 .. most, of blocks of the record that follow one another. All of them together
/// are their mean; how far they scatter says how well that is known.
struct LagCovariances {
  std::vector<Eigen::Index> references;  ///< r rows of the signals
  Eigen::Index lags = 0;                 ///< the highest
  Eigen::MatrixXd mean;                  ///< l r (lags + 1) in one column: R_0, R_1, .. by columns
  Eigen::MatrixXd blocks;                ///< the same less the mean, a column a block
  double block_seconds = 0.0;            ///< length of a block [s]

  /// R_k of the mean.
  Eigen::Map<const Eigen::MatrixXd> At(Eigen::Index k, Eigen::Index l) const {
    const auto r = static_cast<Eigen::Index>(references.size());
    return {mean.data() + k * l * r, l, r};
  }
};

/// Up to `references` of them by pivoted Cholesky of R_0: each time the signal that those before
/// tell least of. `count` blocks at most; no columns where there are fewer than two.
LagCovariances Covariances(const JointSignals& joint, Eigen::Index lags, Eigen::Index references,
                           Eigen::Index count);

/// Means of neighbouring blocks of something that forgets itself in `memory` [s]: of as many as are
/// four memories long, as far as twenty remain.
Eigen::VectorXd Grouped(const Eigen::VectorXd& blocks, double block_seconds, double memory);

/// Standard error of the mean of values of blocks that follow one another, from their scatter once
/// grouped; widened as Student's distribution asks, so that 1.96 of it hold 95%.
double BlockSigma(const Eigen::VectorXd& blocks, double block_seconds, double memory);

}  // namespace unfurl::correlate
