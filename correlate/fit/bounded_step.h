#pragma once

#include <Eigen/Core>

namespace unfurl::correlate {

/// The step s that minimises 2 slope.s + s.(normal s) within low <= s <= high, where low <= 0 <=
/// high, infinite ones allowed; `normal` is symmetric, positive semidefinite, of any units: what is
/// bounded is found set by set of active bounds [Lawson and Hanson 1974, ch. 23]. Where nothing
/// decides, the shortest one in units of the diagonal; what has none of it does not move.
Eigen::VectorXd BoundedStep(const Eigen::MatrixXd& normal, const Eigen::VectorXd& slope,
                            const Eigen::VectorXd& low, const Eigen::VectorXd& high);

}  // namespace unfurl::correlate
