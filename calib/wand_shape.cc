#include "calib/wand_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "base/statistics.h"

namespace unfurl::calib {
namespace {

constexpr double kAlike = 0.5;  // of the largest principal strain: counts as much as that

std::string Direction(Eigen::Vector3d v) {
  Eigen::Index largest = 0;
  v.cwiseAbs().maxCoeff(&largest);
  if (v(largest) < 0.0) v = -v;
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", v.x(), v.y(), v.z());
}

// A strain's name by its principal ones, of which the largest in size is `main`.
std::string NameOf(const Eigen::Vector3d& strain, const Eigen::Matrix3d& axes, Eigen::Index main) {
  const Eigen::Vector3d size = strain / strain(main);
  if (size.minCoeff() > kAlike) return "scale of everything";
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (size(k) > -kAlike) continue;
    return fmt::format("stretch along {} against {}", Direction(axes.col(main)),
                       Direction(axes.col(k)));
  }
  return "scale along " + Direction(axes.col(main));
}

}  // namespace

std::vector<WandShape> ShapesOf(const WandFit& fit, const Eigen::MatrixXd& covariance,
                                const std::vector<WandGridPoint>& grid) {
  std::vector<WandShape> out;
  if (grid.size() < 4) return out;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const WandGridPoint& point : grid) centre += point.p / static_cast<double>(grid.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  double edge = 0.0;
  for (const WandGridPoint& point : grid) {
    const Eigen::Vector3d r = point.p - centre;
    moments += r * r.transpose();
    edge = std::max(edge, r.norm());
  }
  // The strain, six numbers in an orthonormal basis of symmetric matrices, by the parameters: of
  // the displacements' affine part.
  const Eigen::Matrix3d inverse = moments.inverse();
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(6, covariance.rows());
  const auto entry = [](int k) -> std::pair<int, int> {
    constexpr std::pair<int, int> kEntries[6] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    return kEntries[k];
  };
  for (const WandGridPoint& point : grid) {
    const Eigen::RowVector3d lever = (point.p - centre).transpose() * inverse;
    for (int k = 0; k < 6; ++k) {
      const auto [a, b] = entry(k);
      const double weight = a == b ? 0.5 : std::sqrt(0.5);
      K.row(k) +=
          weight * (lever(b) * point.by_cameras.row(a) + lever(a) * point.by_cameras.row(b));
    }
  }
  const Eigen::MatrixXd spread = K * covariance * K.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(spread);
  for (Eigen::Index m = 6; m-- > 0;) {
    Eigen::Matrix3d strain;
    for (int k = 0; k < 6; ++k) {
      const auto [a, b] = entry(k);
      strain(a, b) = strain(b, a) = modes.eigenvectors()(k, m) * (a == b ? 1.0 : std::sqrt(0.5));
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(strain);
    Eigen::Index main = 0;
    principal.eigenvalues().cwiseAbs().maxCoeff(&main);
    WandShape shape;
    shape.name = NameOf(principal.eigenvalues(), principal.eigenvectors(), main);
    shape.sigma =
        std::sqrt(std::max(modes.eigenvalues()(m), 0.0)) * std::abs(principal.eigenvalues()(main));
    shape.moved = shape.sigma * edge;
    const double stated = fit.data.place_sigma / fit.data.Length();
    shape.by_bar = shape.name == "scale of everything" && shape.sigma < std::sqrt(2.0) * stated;
    out.push_back(shape);
  }
  return out;
}

double DistanceSigma(const Eigen::MatrixXd& covariance, const std::vector<WandGridPoint>& grid) {
  constexpr std::size_t kStep = 7;  // pairs across the volume, each point in two of them
  double sum = 0.0, n = 0.0;
  for (std::size_t k = 0; k < grid.size(); ++k) {
    const WandGridPoint& a = grid[k];
    const WandGridPoint& b = grid[(k + grid.size() / 2 + kStep) % grid.size()];
    const Eigen::Vector3d d = b.p - a.p;
    if (!(d.norm() > 0.0)) continue;
    const Eigen::RowVectorXd by = d.normalized().transpose() * (b.by_cameras - a.by_cameras);
    sum += (by * covariance * by.transpose()).value();
    n += 1.0;
  }
  return n > 0.0 ? std::sqrt(std::max(sum / n, 0.0)) : std::numeric_limits<double>::infinity();
}

std::vector<double> PointSigmas(const Eigen::MatrixXd& covariance,
                                const std::vector<WandGridPoint>& grid) {
  std::vector<double> out;
  for (const WandGridPoint& point : grid) {
    const double calibration =
        (point.by_cameras * covariance * point.by_cameras.transpose()).trace();
    out.push_back(std::sqrt(std::max(calibration + point.cov.trace(), 0.0)));
  }
  return out;
}

void MotionOf(const WandFit& fit, WandReport* report) {
  const int last = fit.data.mark_count() - 1;
  std::vector<double> motion, reading, speed;
  const auto poses = static_cast<std::size_t>(fit.data.pose_count());
  std::vector<double> first_flash(poses, 0.0), last_flash(poses, 0.0);
  std::vector<std::vector<char>> use[2];
  for (auto& end : use) end.assign(poses, std::vector<char>(fit.state.cameras.size(), 0));
  for (std::size_t k = 0; k < fit.data.readings.size(); ++k) {
    const WandReading& r = fit.data.readings[k];
    const auto pose = static_cast<std::size_t>(r.pose);
    if (fit.weighting.use_reading[k] == 0) continue;
    if (r.mark == 0) first_flash[pose] = r.after;
    if (r.mark == last) last_flash[pose] = r.after;
    if (r.mark == 0 || r.mark == last) {
      use[r.mark == 0 ? 0 : 1][pose][static_cast<std::size_t>(r.camera)] = 1;
    }
  }
  for (std::size_t k = 0; k < poses; ++k) {
    const auto pose = static_cast<int>(k);
    WandGridPoint a, b;
    if (!PlaceOf(fit, fit.state.Mark(pose, 0, first_flash[k]), use[0][k], &a) ||
        !PlaceOf(fit, fit.state.Mark(pose, last, last_flash[k]), use[1][k], &b)) {
      continue;
    }
    const Eigen::Vector3d d = fit.state.direction.col(pose);
    reading.push_back(std::sqrt(d.dot((a.cov + b.cov) * d)));
    motion.push_back(std::abs(last_flash[k] - first_flash[k]) *
                     std::sqrt(std::max(fit.system.speed_variance[k], 0.0)));
    speed.push_back(fit.state.velocity.col(pose).norm());
  }
  if (reading.empty()) return;
  report->motion_sigma = Median(motion);
  report->reading_sigma = Median(reading);
  report->speed = Median(speed);
}

}  // namespace unfurl::calib
