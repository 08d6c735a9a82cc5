#pragma once

#include <Eigen/Core>

#include "base/random.h"
#include "data/rig.h"

namespace unfurl::calib {

// The linear pinhole of a one-dimensional sensor, u = (a.p + alpha) / (b.p + beta): row 0 holds
// (a, alpha), row 1 (b, beta), scaled so that |b| = 1 and the depth b.p + beta is positive for most
// of the points; it has seven degrees of freedom. [Hartley and Zisserman, ch. 4 and 7, with one
// image coordinate]
using DirectTransform = Eigen::Matrix<double, 2, 4>;

inline constexpr int kDirectTransformPoints = 7;  // fewest that determine it

// Least squares of the algebraic residual over points p (3 x n, [m]) and readings u (n, [px]), both
// normalised first (Hartley). `condition` is the second smallest singular value over the largest:
// near zero when more than one transform fits (coplanar points, and other degenerate layouts).
struct DirectFit {
  DirectTransform transform;
  double condition = 0.0;
};
DirectFit FitDirect(const Eigen::Matrix3Xd& p, const Eigen::VectorXd& u_px);

// The same for data with gross errors: the transform of many random subsets whose median absolute
// residual over all points is least, then refitted to the points within a few robust sigmas.
struct RobustDirectFit {
  DirectFit fit;
  Eigen::Array<bool, Eigen::Dynamic, 1> inlier;  // n
  double sigma_px = 0.0;  // robust scale of the residuals, lens error included
};
RobustDirectFit FitDirectRobust(const Eigen::Matrix3Xd& p, const Eigen::VectorXd& u_px, Rng rng);

// Reading that the transform predicts, and the residuals u - prediction (infinite behind it).
Eigen::VectorXd DirectResiduals(const DirectTransform& transform, const Eigen::Matrix3Xd& p,
                                const Eigen::VectorXd& u_px);

// Pose, image scale and offset of a transform, with e = 0 and no terms. X is the direction in which
// the readings grow and Y = Z x X, so the rotation is proper whichever way round the sensor is
// mounted. What a pinhole leaves open, the position along the lens axis, is set where `centre`
// (of the points, [m]) has Y = 0.
data::RigCamera CameraFromDirect(const DirectTransform& transform, const Eigen::Vector3d& centre);

}  // namespace unfurl::calib
