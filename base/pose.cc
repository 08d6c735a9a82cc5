#include "base/pose.h"

#include <Eigen/SVD>
#include <cmath>

namespace unfurl {

Eigen::Matrix3d RotationFromVector(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Eigen::Matrix3d::Identity() + Skew(w);
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

Eigen::Vector3d VectorFromRotation(const Eigen::Matrix3d& R) {
  const Eigen::AngleAxisd a(R);
  return a.angle() * a.axis();
}

Eigen::Matrix3d Skew(const Eigen::Vector3d& w) {
  Eigen::Matrix3d S;
  S << 0.0, -w.z(), w.y(), w.z(), 0.0, -w.x(), -w.y(), w.x(), 0.0;
  return S;
}

RigidFit FitRigid(const Eigen::Matrix3Xd& p_A, const Eigen::Matrix3Xd& p_B,
                  const Eigen::VectorXd& weights) {
  const Eigen::Index n = p_A.cols();
  const Eigen::VectorXd w = weights.size() == n ? weights : Eigen::VectorXd::Ones(n);
  const double total = w.sum();
  const Eigen::Vector3d mean_A = p_A * w / total;
  const Eigen::Vector3d mean_B = p_B * w / total;
  const Eigen::Matrix3d H =
      (p_B.colwise() - mean_B) * w.asDiagonal() * (p_A.colwise() - mean_A).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1.0, 1.0, 1.0);
  if ((svd.matrixV() * svd.matrixU().transpose()).determinant() < 0.0) sign.z() = -1.0;

  RigidFit fit;
  fit.X_AB.linear() = svd.matrixV() * sign.asDiagonal() * svd.matrixU().transpose();
  fit.X_AB.translation() = mean_A - fit.X_AB.linear() * mean_B;
  const Eigen::Matrix3Xd left = p_A - fit.X_AB * p_B;
  fit.rms = std::sqrt(left.colwise().squaredNorm().dot(w) / total);
  fit.rank_deficient = svd.singularValues()(1) <= 1e-12 * svd.singularValues()(0);
  return fit;
}

}  // namespace unfurl
