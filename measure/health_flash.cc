// One flash as evidence on cameras: its readings without what the mark's place explains.
#include "measure/health_flash.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "base/dense.h"
#include "measure/camera_model.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kJointSlices = 40;  // of time, over which residuals are averaged

}  // namespace

FlashErrors::FlashErrors(const Triangulator& triangulator) : triangulator_(triangulator) {
  const Eigen::MatrixXd& whole = triangulator.rig_factor();
  std::vector<Eigen::Index> kept;
  for (Eigen::Index k = 0; k < whole.cols(); ++k) {
    if (whole.col(k).squaredNorm() > 0.0) kept.push_back(k);
  }
  const auto rows = static_cast<Eigen::Index>(triangulator.cameras()) * data::kCameraParameters;
  factor_.resize(rows, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t k = 0; k < kept.size(); ++k) {
    factor_.col(static_cast<Eigen::Index>(k)) = whole.col(kept[k]);
  }
}

Eigen::Index FlashErrors::columns() const {
  return factor_.cols() + static_cast<Eigen::Index>(triangulator_.cameras());
}

std::optional<FlashTerms> FlashErrors::TermsOf(const HealthEvidence& evidence, std::size_t i,
                                               std::span<const double> taken,
                                               Eigen::Vector3d* last) const {
  const data::Rig& rig = triangulator_.rig();
  const std::size_t cameras = triangulator_.cameras();
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  for (std::size_t c = 0; c < cameras; ++c) {
    u[c] = evidence.At(i, c).u_px - taken[c];
    s[c] = evidence.At(i, c).s_px;
  }
  const PointSolution point = triangulator_.Solve({u.data(), cameras}, {s.data(), cameras}, *last);
  if (point.outcome != PointOutcome::kSolved && point.outcome != PointOutcome::kDisagree) {
    return {};
  }
  if (point.readings < 4) return {};
  *last = point.p;
  const auto C = static_cast<Eigen::Index>(cameras);
  FlashTerms out;
  out.line = i;
  out.readings = point.readings;
  out.chi_square = point.chi_square;
  out.r = Eigen::VectorXd::Zero(C);
  Eigen::VectorXd w = Eigen::VectorXd::Zero(C);
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(C, 3);
  out.G = Eigen::MatrixXd::Zero(C, columns());
  for (Eigen::Index c = 0; c < C; ++c) {
    const auto k = static_cast<std::size_t>(c);
    Projection seen;
    if ((point.cameras >> k & 1U) == 0 || !Project(rig.cameras[k], point.p, &seen)) continue;
    const double floor = data::FloorOf(rig, k);
    w(c) = 1.0 / (s[k] * s[k] + floor * floor);
    J.row(c) = seen.du_dp;
    out.r(c) = u[k] - seen.u_px;
    out.G.row(c).head(factor_.cols()) =
        seen.du_dc * factor_.middleRows(c * data::kCameraParameters, data::kCameraParameters);
    out.G(c, factor_.cols() + c) = floor;
  }
  const Eigen::MatrixXd WJ = w.asDiagonal() * J;
  const Eigen::Matrix3d A = J.transpose() * WJ;
  out.P = -WJ * A.inverse() * WJ.transpose();
  out.P.diagonal() += w;
  return out;
}

double Overdispersion(const HealthEvidence& evidence, std::span<const FlashTerms> flashes,
                      const std::function<Eigen::VectorXd(const FlashTerms&)>& left) {
  struct Cell {
    Eigen::MatrixXd P;
    Eigen::VectorXd y;
  };
  std::map<std::pair<int, int>, Cell> cells;
  const double from = evidence.size() > 0 ? evidence.t(0) : 0.0;
  const double span = evidence.size() > 0 ? evidence.t(evidence.size() - 1) - from : 0.0;
  for (const FlashTerms& flash : flashes) {
    const double at = span > 0.0 ? (evidence.t(flash.line) - from) / span : 0.0;
    const int slice = std::min<int>(kJointSlices - 1, static_cast<int>(at * kJointSlices));
    Cell& cell = cells[{evidence.mark(flash.line), slice}];
    if (cell.P.size() == 0) {
      cell = {Eigen::MatrixXd::Zero(flash.P.rows(), flash.P.rows()),
              Eigen::VectorXd::Zero(flash.P.rows())};
    }
    cell.P += flash.P;
    cell.y += flash.P * left(flash);
  }
  double squares = 0.0, degrees = 0.0;
  for (const auto& [at, cell] : cells) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(cell.P);
    const Eigen::Index C = cell.P.rows();
    const double largest = eigen.eigenvalues()(C - 1);
    for (Eigen::Index k = 0; k < C; ++k) {
      // Directions that a place explains have no weight, those between hardly any.
      constexpr double kWeight = 1e-2;  // of the largest
      const double weight = eigen.eigenvalues()(k);
      if (!(weight > kWeight * largest)) continue;
      const double part = eigen.eigenvectors().col(k).dot(cell.y);
      squares += part * part / weight;
      degrees += 1.0;
    }
  }
  return degrees > 0.0 ? std::max(1.0, squares / degrees) : 1.0;
}

}  // namespace unfurl::measure
