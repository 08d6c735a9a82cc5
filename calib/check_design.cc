#include "calib/check_design.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "base/pose.h"
#include "calib/parameters.h"
#include "measure/camera_model.h"

namespace unfurl::calib {
namespace {

double SizeOf(const data::Rig& rig) { return (rig.volume_high - rig.volume_low).norm(); }

// A camera is turned and displaced by what moves readings by about a pixel.
using CameraMove = Eigen::Matrix<double, 6, 1>;
CameraMove PixelOfPose(const data::Rig& rig, const data::RigCamera& camera) {
  const Eigen::Vector3d middle = 0.5 * (rig.volume_low + rig.volume_high);
  CameraMove out = CameraMove::Constant(1.0 / camera.f_px);
  out.tail<3>() *= (middle - camera.p_WC).norm();
  return out;
}

}  // namespace

Eigen::MatrixXd CheckDesign::Shifts(std::size_t cameras) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(misfit.size(), static_cast<Eigen::Index>(cameras));
  for (std::size_t r = 0; r < camera.size(); ++r) {
    const Effect& reading = by_reading[r];
    out.col(camera[r]).segment(reading.first, reading.rows.rows()) += reading.rows;
  }
  return out;
}

std::vector<std::size_t> MatchCameras(const data::Rig& rig, const Observations& data,
                                      const std::string& where) {
  std::vector<std::size_t> out;
  for (const std::string& name : data.cameras) {
    std::size_t k = 0;
    while (k < rig.cameras.size() && rig.cameras[k].name != name) ++k;
    if (k == rig.cameras.size()) {
      throw Error(fmt::format("camera \"{}\" is not one of the rig's", name), where,
                  "name the cameras as the rig does (# cameras: ...)");
    }
    out.push_back(k);
  }
  return out;
}

double ReadingVariance(const data::Rig& rig, std::size_t camera, double s_px) {
  const double floor = data::FloorOf(rig, camera);
  return s_px * s_px + floor * floor;
}

Eigen::MatrixXd SharedByRig(const data::Rig& rig, const Eigen::MatrixXd& by_camera) {
  // Parameters have units; scaling by their sigmas keeps the small ones from drowning.
  const Eigen::VectorXd sigma = rig.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd inverse = sigma.unaryExpr([](double s) { return s > 0.0 ? 1.0 / s : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse.asDiagonal() * rig.covariance *
                                                             inverse.asDiagonal());
  const Eigen::MatrixXd factor = sigma.asDiagonal() * eigen.eigenvectors() *
                                 eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return by_camera * factor;
}

CheckDesign DesignOfPoints(const data::Rig& rig, const Observations& data,
                           const std::vector<std::size_t>& match, const std::string& where) {
  const auto n = static_cast<Eigen::Index>(data.readings.size());
  CheckDesign design;
  design.misfit.resize(n);
  design.by_camera.setZero(n, rig.covariance.rows());
  design.by_frame.resize(n, 6);
  const Eigen::Vector3d middle = 0.5 * (rig.volume_low + rig.volume_high);
  Eigen::MatrixXd H(n, 3);
  Eigen::VectorXd own(n);  // variance of each reading alone
  for (Eigen::Index k = 0; k < n; ++k) {
    const Reading& r = data.readings[static_cast<std::size_t>(k)];
    const std::size_t c = match[static_cast<std::size_t>(r.camera)];
    measure::Projection h;
    if (!measure::Project(rig.cameras[c], data.p.col(r.point), &h)) {
      throw Error(fmt::format("point \"{}\" lies behind camera \"{}\"",
                              data.ids[static_cast<std::size_t>(r.point)], rig.cameras[c].name),
                  where,
                  "correct where it is, or measure in the frame in which the rig was surveyed");
    }
    design.misfit(k) = r.u_px - h.u_px;
    design.camera.push_back(static_cast<int>(c));
    design.point.push_back(r.point);
    design.by_reading.push_back({k, Eigen::MatrixXd::Ones(1, 1)});
    H.row(k) = h.du_dp;
    own(k) = ReadingVariance(rig, c, r.s_px);
    design.by_camera.block(k, kParameters * static_cast<Eigen::Index>(c), 1, kParameters) = h.du_dc;
    // Turned about the volume's middle, by an angle that moves its corners by half a metre.
    const Eigen::Vector3d arm = (data.p.col(r.point) - middle) / SizeOf(rig);
    design.by_frame.row(k) << h.du_dp, -h.du_dp * Skew(arm);
  }
  // Readings of one point are neighbours (Observations).
  Eigen::Index first = 0;
  for (int i = 0; i < data.points(); ++i) {
    Eigen::Index m = 0;
    while (first + m < n && design.point[static_cast<std::size_t>(first + m)] == i) ++m;
    design.by_point.push_back({first, H.middleRows(first, m)});
    if (m == 0) continue;
    const Eigen::MatrixXd& by_place = design.by_point.back().rows;
    design.covariance.own.emplace_back(by_place * data.cov[static_cast<std::size_t>(i)] *
                                       by_place.transpose());
    design.covariance.own.back().diagonal() += own.segment(first, m);
    first += m;
  }
  // What the station does to all points: with another set-up than the calibration's, another error.
  Eigen::MatrixXd& shared = design.covariance.shared;
  shared = SharedByRig(rig, design.by_camera);
  for (const CommonError& error : data.common) {
    shared.conservativeResize(Eigen::NoChange, shared.cols() + 1);
    for (Eigen::Index k = 0; k < n; ++k) {
      shared(k, shared.cols() - 1) =
          H.row(k).dot(error.shift.col(design.point[static_cast<std::size_t>(k)]));
    }
  }
  return design;
}

std::vector<Hypothesis> HypothesesOf(const data::Rig& rig, const CheckDesign& design,
                                     const CheckOptions& options) {
  std::vector<Hypothesis> out;
  const Eigen::MatrixXd shifts = design.Shifts(rig.cameras.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const data::RigCamera& camera = rig.cameras[c];
    const auto j = static_cast<int>(c);
    const double half = 0.5 * options.camera_odds;
    out.push_back({CauseKind::kCamera, j, {0, shifts.col(j)}, 1.0 * camera.pixels, half});
    out.push_back({CauseKind::kCamera,
                   j,
                   {0, design.by_camera.middleCols(kParameters * j, CameraMove::RowsAtCompileTime) *
                           PixelOfPose(rig, camera).asDiagonal()},
                   1.0 * camera.pixels,
                   half});
  }
  const double size = SizeOf(rig);
  for (std::size_t i = 0; i < design.by_point.size(); ++i) {
    out.push_back(
        {CauseKind::kPoint, static_cast<int>(i), design.by_point[i], size, options.point_odds});
  }
  for (std::size_t r = 0; r < design.camera.size(); ++r) {
    out.push_back({CauseKind::kReading, static_cast<int>(r), design.by_reading[r],
                   1.0 * rig.cameras[static_cast<std::size_t>(design.camera[r])].pixels,
                   options.reading_odds});
  }
  out.push_back({CauseKind::kFrame, 0, {0, design.by_frame}, size, options.frame_odds});
  return out;
}

Moved MovedBy(const data::Rig& rig, const Observations& data, const std::vector<std::size_t>& match,
              const std::vector<FoundCause>& causes) {
  const auto cameras = static_cast<Eigen::Index>(rig.cameras.size());
  Moved out{Eigen::VectorXd::Zero(kParameters * cameras), Eigen::VectorXd::Zero(cameras),
            Eigen::Matrix3Xd::Zero(3, data.p.cols())};
  for (const FoundCause& one : causes) {
    if (one.kind == CauseKind::kPoint && one.amount.size() == 3) {
      const Eigen::Vector3d there = data.p.col(one.index) + one.amount;
      double u = 0.0;
      const bool seen =
          std::all_of(data.readings.begin(), data.readings.end(), [&](const Reading& r) {
            const std::size_t c = match[static_cast<std::size_t>(r.camera)];
            return r.point != one.index || measure::Project(rig.cameras[c], there, &u);
          });
      if (seen) out.places.col(one.index) = one.amount;
    }
    if (one.kind != CauseKind::kCamera) continue;
    if (one.amount.size() == 1) {
      out.shift_px(one.index) = one.amount(0);
    } else {
      const data::RigCamera& camera = rig.cameras[static_cast<std::size_t>(one.index)];
      out.parameters.segment<CameraMove::RowsAtCompileTime>(kParameters * one.index) =
          PixelOfPose(rig, camera).cwiseProduct(one.amount);
    }
  }
  return out;
}

}  // namespace unfurl::calib
