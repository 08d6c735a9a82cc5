#pragma once

#include <Eigen/Core>

namespace unfurl::correlate {

/// w of Broyden's rank-one update B += (y - B s) w^T, which makes B s the change y that a step s
/// has shown: w^T s = 1, and of all such updates the least change in standard errors `sigma` (of
/// the step's unknowns; one of 0 takes no part). Empty: there is no step. [Broyden 1965, Math.
/// Comp. 19, 577-593]
Eigen::VectorXd BroydenWeights(const Eigen::VectorXd& step, const Eigen::VectorXd& sigma);

}  // namespace unfurl::correlate
