#include "calib/direct_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::calib {
namespace {

constexpr int kSubsets = 400;       // 30% gross errors leave > 99.9% chance of a clean subset of 10
constexpr int kLargestSubset = 12;  // larger than minimal, so that lens error averages out
constexpr int kRefits = 5;          // for the set of inliers to settle
// Of the robust sigma: normal errors of a hundred readings all stay below it
// in 95 cases of 100 (0.99953 each).
constexpr double kInlierSigmas = 3.5;

void ScaleToDepth(const Eigen::Matrix3Xd& p, DirectTransform* transform) {
  *transform /= transform->row(1).head<3>().norm();
  const Eigen::RowVectorXd depth = (transform->row(1).head<3>() * p).array() + (*transform)(1, 3);
  if ((depth.array() > 0.0).count() * 2 < p.cols()) *transform = -*transform;
}

std::vector<int> RandomSubset(int n, int size, Rng* rng, std::vector<int>* scratch) {
  scratch->resize(static_cast<std::size_t>(n));
  std::iota(scratch->begin(), scratch->end(), 0);
  for (int k = 0; k < size; ++k) {
    const auto other = static_cast<std::ptrdiff_t>(rng->Integer(static_cast<std::uint64_t>(n - k)));
    std::swap((*scratch)[static_cast<std::size_t>(k)], *(scratch->begin() + k + other));
  }
  return {scratch->begin(), scratch->begin() + size};
}

double MedianAbsolute(const Eigen::VectorXd& residuals) {
  std::vector<double> sizes(static_cast<std::size_t>(residuals.size()));
  Eigen::VectorXd::Map(sizes.data(), residuals.size()) = residuals.cwiseAbs();
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

}  // namespace

DirectFit FitDirect(const Eigen::Matrix3Xd& p, const Eigen::VectorXd& u_px) {
  const Eigen::Index n = p.cols();
  const Eigen::Vector3d centre = p.rowwise().mean();
  const double spread = std::sqrt((p.colwise() - centre).squaredNorm() / static_cast<double>(n));
  const double u_mean = u_px.mean();
  const double u_spread =
      std::sqrt((u_px.array() - u_mean).square().sum() / static_cast<double>(n));
  const double p_scale = spread > 0.0 ? std::sqrt(3.0) / spread : 1.0;
  const double u_scale = u_spread > 0.0 ? 1.0 / u_spread : 1.0;

  Eigen::Matrix<double, Eigen::Dynamic, 8> rows(n, 8);
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::RowVector4d q;
    q << p_scale * (p.col(i) - centre).transpose(), 1.0;
    rows.row(i) << q, -u_scale * (u_px(i) - u_mean) * q;
  }
  // Of any size: the solver of eight by eight would be compiled for this place alone.
  const Eigen::MatrixXd moments = rows.transpose() * rows;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(moments);
  const Eigen::Matrix<double, 8, 1> v = eigen.eigenvectors().col(0);

  Eigen::Matrix4d normalise = Eigen::Matrix4d::Identity();
  normalise.topLeftCorner<3, 3>() *= p_scale;
  normalise.topRightCorner<3, 1>() = -p_scale * centre;
  DirectTransform transform;
  transform.row(1) = v.tail<4>().transpose() * normalise;
  transform.row(0) = v.head<4>().transpose() * normalise / u_scale + u_mean * transform.row(1);

  DirectFit out;
  out.condition =
      std::sqrt(std::max(eigen.eigenvalues()(1), 0.0) / std::max(1e-300, eigen.eigenvalues()(7)));
  ScaleToDepth(p, &transform);
  out.transform = transform;
  return out;
}

Eigen::VectorXd DirectResiduals(const DirectTransform& transform, const Eigen::Matrix3Xd& p,
                                const Eigen::VectorXd& u_px) {
  Eigen::VectorXd out(p.cols());
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const double depth = transform.row(1).head<3>().dot(p.col(i)) + transform(1, 3);
    const double across = transform.row(0).head<3>().dot(p.col(i)) + transform(0, 3);
    out(i) = depth > 0.0 ? u_px(i) - across / depth : std::numeric_limits<double>::infinity();
  }
  return out;
}

RobustDirectFit FitDirectRobust(const Eigen::Matrix3Xd& p, const Eigen::VectorXd& u_px, Rng rng) {
  const int n = static_cast<int>(p.cols());
  const int size = std::min(n, std::clamp(n / 4, kDirectTransformPoints + 1, kLargestSubset));
  const auto fit_to = [&](const std::vector<int>& subset) {
    return FitDirect(p(Eigen::all, subset), u_px(subset));
  };

  RobustDirectFit best;
  double best_median = std::numeric_limits<double>::infinity();
  std::vector<int> scratch;
  for (int trial = 0; trial <= kSubsets; ++trial) {
    const DirectFit fit =
        trial == 0 ? FitDirect(p, u_px) : fit_to(RandomSubset(n, size, &rng, &scratch));
    const double median = MedianAbsolute(DirectResiduals(fit.transform, p, u_px));
    if (median < best_median) {
      best_median = median;
      best.fit = fit;
    }
  }

  for (int refit = 0; refit < kRefits; ++refit) {
    const Eigen::VectorXd residuals = DirectResiduals(best.fit.transform, p, u_px);
    best.sigma_px = 1.4826 * MedianAbsolute(residuals);
    // A floor for noise-free data, where the median is round-off.
    const double round_off = 1e-9 * (u_px.maxCoeff() - u_px.minCoeff());
    const double limit = std::max(kInlierSigmas * best.sigma_px, round_off);
    best.inlier = residuals.array().abs() <= limit;
    std::vector<int> inliers;
    for (int i = 0; i < n; ++i) {
      if (best.inlier(i)) inliers.push_back(i);
    }
    if (static_cast<int>(inliers.size()) < kDirectTransformPoints) break;
    DirectFit fit = fit_to(inliers);
    if (MedianAbsolute(DirectResiduals(fit.transform, p, u_px)) > 1.5 * best_median + round_off)
      break;
    best.fit = fit;
  }
  return best;
}

data::RigCamera CameraFromDirect(const DirectTransform& transform, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d a = transform.row(0).head<3>(), Z = transform.row(1).head<3>();
  data::RigCamera camera;
  camera.u0_px = a.dot(Z);  // |Z| = 1
  const Eigen::Vector3d across = a - camera.u0_px * Z;
  camera.f_px = across.norm();
  const Eigen::Vector3d X = across / camera.f_px, Y = Z.cross(X);
  camera.R_CW.row(0) = X;
  camera.R_CW.row(1) = Y;
  camera.R_CW.row(2) = Z;
  const double t_x = (transform(0, 3) - camera.u0_px * transform(1, 3)) / camera.f_px;
  const double t_z = transform(1, 3);
  camera.p_WC = -t_x * X - t_z * Z + Y * Y.dot(centre);
  return camera;
}

}  // namespace unfurl::calib
