#pragma once

#include <Eigen/Geometry>

namespace unfurl {

// X_AB takes a point from frame B to frame A: p_AP = X_AB * p_BP. Lengths in [m].
using Pose = Eigen::Isometry3d;

// Rotation of angle |w| about w [rad], and its inverse (result in the ball of radius pi).
Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& w);
Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& R);

// [w]x, so that Skew(w) * v = w x v.
Eigen::Matrix3d Skew(const Eigen::Vector3d& w);

// The rigid pose X_AB that minimises sum_i weight_i |p_A_i - X_AB p_B_i|^2 (Kabsch; never a mirror
// image). Points are columns, 3 x n with n >= 3; weights n, >= 0, or empty for equal ones.
// Collinear points leave the rotation about their line arbitrary: `rank_deficient` says so.
struct RigidFit {
  Pose X_AB = Pose::Identity();
  double rms = 0.0;  // weighted RMS distance after the fit [m]
  bool rank_deficient = false;
};
RigidFit FitRigid(const Eigen::Matrix3Xd& p_A, const Eigen::Matrix3Xd& p_B,
                  const Eigen::VectorXd& weights = {});

}  // namespace unfurl
