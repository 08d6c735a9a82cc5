#include "correlate/fit/broyden.h"

namespace unfurl::correlate {

// W s / (s^T W s) with W = 1 / sigma^2.
Eigen::VectorXd BroydenWeights(const Eigen::VectorXd& step, const Eigen::VectorXd& sigma) {
  Eigen::VectorXd weighted = Eigen::VectorXd::Zero(step.size());
  for (Eigen::Index j = 0; j < step.size(); ++j) {
    if (sigma(j) > 0.0) weighted(j) = step(j) / (sigma(j) * sigma(j));
  }
  const double square = step.dot(weighted);
  if (!(square > 0.0)) return {};
  return weighted / square;
}

}  // namespace unfurl::correlate
