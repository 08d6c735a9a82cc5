#pragma once

#include <Eigen/Core>

#include "data/rig.h"

namespace unfurl::measure {

// The reading that the two-centre model predicts for a point, and its derivatives.
struct Projection {
  double u_px = 0.0;                                        // [px]
  Eigen::RowVector3d du_dp;                                 // by the point in W [px/m]
  Eigen::Matrix<double, 1, data::kCameraParameters> du_dc;  // by the camera's parameters, in the
                                                            // order of data/rig.h [px/unit]
};

// False, and `out` untouched, for a point that is not in front (kLeastSlope).
bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, double* u_px);
bool Project(const data::RigCamera& camera, const Eigen::Vector3d& p_W, Projection* out);

// d reading / d p, by the point in W; zero for one that is not in front [px/m].
Eigen::Vector3d ReadingGradient(const data::RigCamera& camera, const Eigen::Vector3d& p_W);

// The camera after a small change of its parameters, in the order of data/rig.h.
data::RigCamera Perturbed(const data::RigCamera& camera,
                          const Eigen::Matrix<double, data::kCameraParameters, 1>& change);

}  // namespace unfurl::measure
