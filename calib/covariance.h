#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"

namespace unfurl::calib {

// Information (inverse covariance) that readings and survey give of all cameras' parameters, 19 c x
// 19 c in the order of data/rig.h: the normal equations at a solution, with the loss's weights,
// every point eliminated by its Schur complement. The points' survey noise, which the cameras share
// because they share the points, is in it. `fixed_points`: the survey counts as exact.
Eigen::MatrixXd DataInformation(const Observations& data, double floor_px, bool fixed_points,
                                const BundleState& state, const std::vector<double>& reading_weight,
                                const std::vector<double>& survey_weight);

// What the priors add to it: block diagonal.
Eigen::MatrixXd PriorInformation(const std::vector<CameraPrior>& priors);

// Inverse of an information matrix, symmetric and positive semidefinite. Parameters are scaled to
// unit information first, so that pixels and radians invert alike.
Eigen::MatrixXd CameraCovariance(const Eigen::MatrixXd& information);

}  // namespace unfurl::calib
