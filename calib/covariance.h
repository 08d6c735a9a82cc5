#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"

namespace unfurl::calib {

// Information (inverse covariance) that readings and survey give of all cameras' parameters, 31 c x
// 31 c in the order of data/rig.h, and after them of the survey's common errors in their sigmas,
// unless the points are fixed: the normal equations at a solution, with the loss's weights,
// every point eliminated by its Schur complement. The points' survey noise, which the cameras share
// because they share the points, is in it. `fixed_points`: the survey counts as exact.
Eigen::MatrixXd DataInformation(const Observations& data, const std::vector<CameraPrior>& priors,
                                const Weighting& weighting, bool fixed_points,
                                const BundleState& state, const std::vector<double>& reading_weight,
                                const std::vector<double>& survey_weight);

// What the priors add to it: block diagonal; 1 px^-2 for a term that is held at zero, 1 for each
// common error.
Eigen::MatrixXd PriorInformation(const std::vector<CameraPrior>& priors, std::size_t common = 0);

// Inverse of an information matrix, symmetric and positive semidefinite. Parameters are scaled to
// unit information first, so that pixels and radians invert alike.
Eigen::MatrixXd CameraCovariance(const Eigen::MatrixXd& information);

// Standard deviation of a vector along itself; of one that is zero the largest along an axis.
double SigmaAlong(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& v);

// Zero rows and columns for the terms that are held at zero.
void ClearFixed(const std::vector<CameraPrior>& priors, Eigen::MatrixXd* covariance);

// What of each datum is left over to check the fit with: 1 - leverage per reading, and 3 - trace of
// it per surveyed point; 0 for what takes no part. Their sum is the degrees of freedom. A squared
// whitened residual has this mean when its stated variance is true. `covariance` is the inverse of
// the whole information.
struct Redundancy {
  std::vector<double> reading, survey;  // [-]
  // Of a reading that takes no part: the variance that the cameras' errors give what the others
  // make of it, over what it would have by the readings' and the survey's errors alone. Above 1 the
  // model knows less of it there than the reading itself; 0 for readings that take part [-].
  std::vector<double> by_rig;
};
Redundancy RedundancyOf(const Observations& data, const std::vector<CameraPrior>& priors,
                        const Weighting& weighting, const BundleState& state,
                        const Eigen::MatrixXd& covariance);

}  // namespace unfurl::calib
