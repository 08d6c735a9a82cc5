#include "measure/vouching.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/length.h"
#include "base/statistics.h"
#include "measure/camera_model.h"
#include "measure/health.h"

namespace unfurl::measure {

namespace {

constexpr std::size_t kPlaces = 300;  // that are looked at: a median of more is no other

}  // namespace

Unvouched FindUnvouched(const HealthEvidence& evidence, const Triangulator& triangulator) {
  const std::size_t cameras = triangulator.cameras();
  // An odd stride meets all marks of a turn of any length but its own multiples.
  const std::size_t stride = std::max<std::size_t>(1, evidence.size() / kPlaces) | 1U;
  std::vector<std::vector<double>> moved(cameras);  // [m/px]
  std::vector<double> stated;                       // [m]
  std::array<double, CameraBank::kMaxCameras> u{}, s{};
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  for (std::size_t i = 0; i < evidence.size(); i += stride) {
    if (evidence.mark(i) < 0) continue;
    for (std::size_t c = 0; c < cameras; ++c) {
      u[c] = evidence.At(i, c).u_px;
      s[c] = evidence.At(i, c).s_px;
    }
    const PointSolution point =
        triangulator.Solve({u.data(), cameras}, {s.data(), cameras}, triangulator.centre());
    if (point.outcome != PointOutcome::kSolved) continue;
    Eigen::Matrix3d rest = Eigen::Matrix3d::Zero();
    triangulator.SharedFactor(point, {s.data(), cameras}, F, &rest);
    stated.push_back(std::sqrt((point.cov + rest).trace() + F.squaredNorm()));
    for (std::size_t c = 0; c < cameras; ++c) {
      Projection seen;
      const data::Rig& rig = triangulator.rig();
      if ((point.cameras >> c & 1U) == 0 || !Project(rig.cameras[c], point.p, &seen)) continue;
      const double floor = data::FloorOf(rig, c);
      moved[c].push_back((point.cov * seen.du_dp.transpose()).norm() /
                         (s[c] * s[c] + floor * floor));
    }
  }
  Unvouched out;
  if (stated.empty()) return out;
  out.any = true;
  out.stated = Median(stated);
  for (std::size_t c = 0; c < cameras; ++c) {
    const double here = moved[c].empty() ? 0.0 : Median(moved[c]);
    out.by_camera.push_back(here);
    if (here <= out.metres_per_px) continue;
    out.metres_per_px = here;
    out.camera = static_cast<int>(c);
  }
  return out;
}

void Unvouched::Narrow(std::span<const double> shows_px) {
  for (std::size_t c = 0; c < by_camera.size() && c < shows_px.size(); ++c) {
    hidden = std::max(hidden, by_camera[c] * shows_px[c]);
  }
  any = any && hidden > stated;
}

void Unvouched::Weigh(std::span<const double> shows) {
  hidden = 0.0;
  for (std::size_t c = 0; c < by_camera.size() && c < shows.size(); ++c) {
    if (!(by_camera[c] * shows[c] > hidden)) continue;
    hidden = by_camera[c] * shows[c];
    camera = static_cast<int>(c);
    metres_per_px = by_camera[c];
    shows_px = shows[c];
  }
  any = any && hidden > stated;
}

void Unvouched::Widen(double factor) {
  stated *= factor;
  any = any && !(hidden > 0.0 && hidden <= stated);
}

std::string Describe(const Unvouched& unvouched, std::span<const std::string> cameras) {
  if (!unvouched.any || unvouched.camera < 0) return {};
  if (unvouched.shows_px > 0.0) {
    return fmt::format(
        "little vouches for camera {}: the others hardly show a shift of it below {:.2g} px, which "
        "moves places by {}, and error bars state {}",
        cameras[static_cast<std::size_t>(unvouched.camera)], unvouched.shows_px,
        LengthText(unvouched.hidden), LengthText(unvouched.stated));
  }
  if (unvouched.hidden > 0.0) {
    return fmt::format(
        "little vouches for the cameras: three readings meet in a point whatever became of theirs, "
        "and the distances that marks keep show only what moves places by more than {}, where "
        "error bars state {}",
        LengthText(unvouched.hidden), LengthText(unvouched.stated));
  }
  return fmt::format(
      "nothing vouches for the cameras: three readings meet in a point whatever became of theirs, "
      "so one that was bumped, is late or exchanged does not show; one pixel of camera {} moves "
      "places by {}, and error bars state {}",
      cameras[static_cast<std::size_t>(unvouched.camera)], LengthText(unvouched.metres_per_px),
      LengthText(unvouched.stated));
}

void AllowForShifts(double sigma_px, data::Rig* rig) {
  constexpr Eigen::Index kOffset = 7;  // u0, in the order of kCameraParameters
  const auto size = static_cast<Eigen::Index>(rig->cameras.size()) * data::kCameraParameters;
  if (rig->covariance.size() == 0) rig->covariance = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index k = kOffset; k < size; k += data::kCameraParameters) {
    rig->covariance(k, k) += sigma_px * sigma_px;
  }
}

}  // namespace unfurl::measure
