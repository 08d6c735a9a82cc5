#include "measure/triangulate.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

double FloorSquare(const data::Rig& rig, std::size_t camera) {
  const double floor = data::FloorOf(rig, camera);
  return floor * floor;
}

constexpr int kMaxCameras = 32;  // bits of the camera set

}  // namespace

const char* Name(PointOutcome outcome) {
  switch (outcome) {
    case PointOutcome::kSolved:
      return "solved";
    case PointOutcome::kTooFew:
      return "too few readings";
    case PointOutcome::kParallel:
      return "planes too near to parallel";
    case PointOutcome::kOutside:
      return "outside the volume";
    case PointOutcome::kDisagree:
      return "readings disagree";
  }
  return "";
}

Triangulator::Triangulator(const data::Rig& rig, const TriangulateOptions& options)
    : rig_(rig), options_(options), centre_(0.5 * (rig.volume_low + rig.volume_high)) {
  const Eigen::Vector3d margin = options.volume_margin * (rig.volume_high - rig.volume_low);
  low_ = rig.volume_low - margin;
  high_ = rig.volume_high + margin;
  limit_.push_back(0.0);
  for (int dof = 1; dof <= kMaxCameras; ++dof) {
    limit_.push_back(ChiSquareQuantile(1.0 - options.residual_level, dof));
  }
  ReduceFactor();
}

PointSolution Triangulator::Solve(std::span<const double> u_px, std::span<const double> s_px,
                                  const Eigen::Vector3d& start, std::uint32_t use) const {
  constexpr int kMaxSteps = 15;
  constexpr double kConverged = 1e-8;  // of a step [m]
  constexpr double kLongest = 1.0;     // step [m]: the surfaces bend, but not much

  PointSolution point;
  const std::size_t count = rig_.cameras.size();
  for (std::size_t c = 0; c < count; ++c) {
    if ((use >> c & 1U) == 0 || std::isnan(u_px[c])) continue;
    point.cameras |= 1U << c;
    ++point.readings;
  }
  if (point.readings < 3) return point;

  point.p = start;
  point.outcome = PointOutcome::kOutside;
  Eigen::Matrix3d A, geometry;
  bool converged = false;
  for (int step = 0; step < kMaxSteps; ++step) {
    A.setZero();
    geometry.setZero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    point.chi_square = 0.0;
    for (std::size_t c = 0; c < count; ++c) {
      if ((point.cameras >> c & 1U) == 0) continue;
      Projection here;
      if (!Project(rig_.cameras[c], point.p, &here)) return point;
      const double w = 1.0 / (s_px[c] * s_px[c] + FloorSquare(rig_, c));
      const double r = u_px[c] - here.u_px;
      const Eigen::Matrix3d outer = here.du_dp.transpose() * here.du_dp;
      A += w * outer;
      geometry += outer;
      g += w * r * here.du_dp.transpose();
      point.chi_square += w * r * r;
    }
    if (converged) break;
    const double det = A.determinant();
    if (!(det > 0.0)) {
      point.outcome = PointOutcome::kParallel;
      return point;
    }
    Eigen::Vector3d dp = A.inverse() * g;
    const double length = dp.norm();
    if (!std::isfinite(length)) {
      point.outcome = PointOutcome::kParallel;
      return point;
    }
    if (length > kLongest) dp *= kLongest / length;
    point.p += dp;
    converged = length < kConverged;
  }

  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(geometry, Eigen::EigenvaluesOnly);
  const double weakest = eigen.eigenvalues()(0);
  point.dilution = weakest > 0.0 ? 1.0 / std::sqrt(weakest) : HUGE_VAL;
  if (!(point.dilution <= options_.max_dilution)) {
    point.outcome = PointOutcome::kParallel;
    return point;
  }
  if (!converged || !(point.p.array() >= low_.array()).all() ||
      !(point.p.array() <= high_.array()).all()) {
    return point;
  }
  point.cov = A.inverse();
  const int dof = point.readings - 3;
  point.outcome = dof > 0 && point.chi_square > limit_[static_cast<std::size_t>(dof)]
                      ? PointOutcome::kDisagree
                      : PointOutcome::kSolved;
  return point;
}

void Triangulator::SharedFactor(const PointSolution& point, std::span<const double> s_px,
                                Eigen::Ref<Eigen::Matrix3Xd> F) const {
  // The readings are held; the point moves with the rig: A dp = -sum w du_dp^T du_dc dc.
  F.setZero();
  for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
    if ((point.cameras >> c & 1U) == 0) continue;
    Projection here;
    if (!Project(rig_.cameras[c], point.p, &here)) continue;
    const double w = 1.0 / (s_px[c] * s_px[c] + FloorSquare(rig_, c));
    const Eigen::Vector3d lever = -w * (point.cov * here.du_dp.transpose());
    const auto rows = factor_.middleRows(static_cast<Eigen::Index>(c) * data::kCameraParameters,
                                         data::kCameraParameters);
    for (Eigen::Index k = 0; k < factor_.cols(); ++k) {
      F.col(k) += lever * here.du_dc.dot(rows.col(k));
    }
  }
}

// The directions of the rig's covariance that move points of the volume, strongest first, and as
// few as lose no more than the tolerance at any of them.
void Triangulator::ReduceFactor() {
  const Eigen::Index size =
      static_cast<Eigen::Index>(rig_.cameras.size()) * data::kCameraParameters;
  factor_.resize(size, 0);
  if (rig_.covariance.rows() != size || rig_.covariance.isZero(0.0)) return;
  // Parameters have units; scaling by their sigmas keeps the small ones from drowning.
  const Eigen::VectorXd sigma = rig_.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd inverse = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  const Eigen::MatrixXd correlation = inverse.asDiagonal() * rig_.covariance * inverse.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);
  const Eigen::MatrixXd whole = sigma.asDiagonal() * eigen.eigenvectors() *
                                eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();

  // Points on a grid over the volume, with all cameras and with each one missing.
  constexpr int kGrid = 5;
  std::vector<Eigen::MatrixXd> samples;
  std::vector<double> u(rig_.cameras.size()), s(rig_.cameras.size(), 0.01);
  factor_ = whole;
  const Eigen::Vector3d span = rig_.volume_high - rig_.volume_low;
  for (int i = 0; i < kGrid * kGrid * kGrid; ++i) {
    const Eigen::Vector3d at(i % kGrid, i / kGrid % kGrid, i / (kGrid * kGrid));
    const Eigen::Vector3d p = rig_.volume_low + span.cwiseProduct(at) / (kGrid - 1.0);
    bool in_front = true;
    for (std::size_t c = 0; c < u.size(); ++c) {
      in_front = in_front && Project(rig_.cameras[c], p, &u[c]);
    }
    if (!in_front) continue;
    const int missing = rig_.cameras.size() > 3 ? static_cast<int>(rig_.cameras.size()) : 0;
    for (int m = -1; m < missing; ++m) {
      const PointSolution point = Solve(u, s, p, m < 0 ? ~0U : ~(1U << m));
      if (point.outcome != PointOutcome::kSolved) continue;
      Eigen::MatrixXd F(3, whole.cols());
      SharedFactor(point, s, F);
      if (F.norm() > 0.0) samples.push_back(F / F.norm());
    }
  }
  Eigen::MatrixXd moment = Eigen::MatrixXd::Zero(whole.cols(), whole.cols());
  for (const Eigen::MatrixXd& F : samples) moment += F.transpose() * F;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> space(moment);
  const Eigen::MatrixXd basis = space.eigenvectors().rowwise().reverse();
  // What each sample has left after the first k directions, tracked as k grows.
  std::vector<double> left(samples.size(), 1.0);
  Eigen::Index k = 0;
  while (k < basis.cols() && !left.empty() &&
         *std::max_element(left.begin(), left.end()) > options_.shared_tolerance) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      left[i] -= (samples[i] * basis.col(k)).squaredNorm();
    }
    ++k;
  }
  factor_ = whole * basis.leftCols(k);
}

}  // namespace unfurl::measure
