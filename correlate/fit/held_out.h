#pragma once

#include <Eigen/Core>
#include <vector>

namespace unfurl::correlate {

/// How well stretches of a record are predicted by a fit to all others.
struct HeldOut {
  /// Log density of each stretch's rows, whitened [nats]; NaN: the others do not determine what it
  /// takes to predict it, or it has no rows.
  std::vector<double> score;
  std::vector<std::size_t> rows;  ///< of each
};

/// To first order about a fit, without a run of the model: rows `r` and their sensitivities `A` to
/// all unknowns; `stretch`: of each row, -1 for what is known beforehand (priors). The stretch's
/// density is normal, its covariance that of the noise and of what the others leave open. Rows of
/// variance `scale`.
HeldOut PredictHeldOut(const Eigen::VectorXd& r, const Eigen::MatrixXd& A,
                       const std::vector<int>& stretch, double scale);

/// Of two fits to the same rows: by how much `a` predicts better than `b`.
struct PredictiveGain {
  double gain = 0.0;   ///< sum over the stretches of which both have the same rows [nats]
  double sigma = 0.0;  ///< its standard error by the scatter from stretch to stretch [nats]
  int stretches = 0;   ///< that were compared
};
/// Throws Error for other numbers of stretches.
PredictiveGain CompareHeldOut(const HeldOut& a, const HeldOut& b);

}  // namespace unfurl::correlate
