#include "tests/measure/health_trial.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/dense.h"
#include "measure/camera_model.h"
#include "measure/sensor.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr int kMarks = 4;

}  // namespace

data::Lab RingOfCameras(std::size_t cameras, std::size_t every) {
  data::Lab lab = ShippedLab();
  const data::LabCamera like = lab.cameras[0];
  lab.cameras.clear();
  for (std::size_t c = 0; c < cameras; ++c) {
    data::LabCamera camera = like;
    const double turn = 2.0 * M_PI * (static_cast<double>(c) + 0.5) / static_cast<double>(cameras);
    camera.name = "camera" + std::to_string(c);
    camera.position = {std::sqrt(2.0) * std::cos(turn), std::sqrt(2.0) * std::sin(turn), 2.87};
    camera.roll = M_PI / 4.0 * (c % 2 == 0 ? 1.0 : -1.0) + 0.3 * static_cast<double>(c / every);
    lab.cameras.push_back(camera);
  }
  return lab;
}

Eigen::Vector3d HealthTrial::Swing(int mark, double t) {
  const double reach = 0.2 + 0.15 * mark, rate = 2.0 - 0.3 * mark, phase = mark;
  return {reach * std::sin(rate * t + phase), 0.8 * reach * std::cos(1.3 * rate * t + phase),
          0.5 * std::sin(1.7 * rate * t + 2.0 * phase)};
}

HealthTrial::HealthTrial(std::size_t cameras, int lines, int pixels, bool still)
    : HealthTrial(cameras, lines, pixels,
                  still ? [](int, double) { return Eigen::Vector3d(0.1, 0.2, 0.0); } : Way(Swing)) {
}

HealthTrial::HealthTrial(std::size_t cameras, int lines, int pixels, const Way& way,
                         double interval)
    : HealthTrial(RingOfCameras(cameras, 4), lines, pixels, way, interval) {}

HealthTrial::HealthTrial(data::Lab lab, int lines, int pixels, const Way& way, double interval) {
  const std::size_t cameras = lab.cameras.size();
  lab.sensor.format.pitch *= lab.sensor.format.active / static_cast<double>(pixels);
  lab.sensor.format.active = pixels;
  cameras_ = MakeVirtualRig(lab).cameras;
  rig_.volume_low = lab.volume_low;
  rig_.volume_high = lab.volume_high;
  const double scale = pixels / 2160.0;
  const Eigen::Matrix3Xd points = RandomPoints(lab.volume_low, lab.volume_high, 300, 11);
  for (const LensCamera& camera : cameras_) rig_.cameras.push_back(FitCamera(camera, points));
  rig_.model_floor_px = 0.003 * scale;  // what FitCamera leaves, several times over
  Calibrate(points.leftCols(120), scale);
  for (int i = 0; i < lines; ++i) {
    const double t = interval * (i + 0.5);
    const int mark = i % (kMarks + 1) == kMarks ? -1 : i % (kMarks + 1);
    t_.push_back(t);
    mark_.push_back(mark);
    place_.push_back(way(std::max(mark, 0), t));
    if (mark >= 0) truth_.push_back(place_.back());
    for (std::size_t c = 0; c < cameras; ++c) {
      true_u_.push_back(mark < 0 ? kNone : Read(c, place_.back(), 0.0));
    }
  }
}

// As a bundle does: readings of surveyed points whose own errors are free within the station's, so
// that what the points have in common moves all cameras alike.
void HealthTrial::Calibrate(const Eigen::Matrix3Xd& points, double scale) {
  constexpr double kStation = 0.3e-3;  // [m]
  const double reading = 0.02 * scale, term = 0.02 * scale;
  const auto cameras = static_cast<Eigen::Index>(rig_.cameras.size());
  const Eigen::Index size = cameras * data::kCameraParameters;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    Eigen::MatrixXd D = Eigen::MatrixXd::Zero(cameras, size);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(cameras, 3);
    for (Eigen::Index c = 0; c < cameras; ++c) {
      Projection seen;
      if (!Project(rig_.cameras[static_cast<std::size_t>(c)], points.col(i), &seen)) continue;
      D.row(c).segment(c * data::kCameraParameters, data::kCameraParameters) = seen.du_dc / reading;
      J.row(c) = seen.du_dp / reading;
    }
    const Eigen::Matrix3d A =
        J.transpose() * J + Eigen::Matrix3d::Identity() / (kStation * kStation);
    information += D.transpose() * (D - J * A.inverse() * (J.transpose() * D));
  }
  for (Eigen::Index k = 0; k < size; ++k) {
    if (k % data::kCameraParameters >= data::kFirstTerm) information(k, k) += 1.0 / (term * term);
  }
  const Eigen::VectorXd unit = information.diagonal().cwiseMax(1e-12).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * information *
                                                             unit.asDiagonal());
  const Eigen::VectorXd inverse =
      eigen.eigenvalues().unaryExpr([](double v) { return v > 1e-9 ? 1.0 / std::sqrt(v) : 0.0; });
  factor_ = unit.asDiagonal() * eigen.eigenvectors() * inverse.asDiagonal();
  covariance_ = factor_ * factor_.transpose();
}

double HealthTrial::Read(std::size_t camera, const Eigen::Vector3d& p, double shift_px) const {
  LensCamera moved = cameras_[camera];
  moved.sensor.centre -= shift_px * moved.sensor.pitch * moved.sensor.row;
  SpotLight spot;
  return TraceSpot(moved, p, &spot) ? spot.centre_px : kNone;
}

data::Rig HealthTrial::DrawRig(Rng* rng) const {
  data::Rig rig = rig_;
  rig.covariance = covariance_;
  Eigen::VectorXd z(factor_.cols());
  for (Eigen::Index k = 0; k < z.size(); ++k) z(k) = rng->Normal();
  const Eigen::VectorXd change = factor_ * z;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    rig.cameras[c] =
        Perturbed(rig.cameras[c], change.segment<data::kCameraParameters>(
                                      static_cast<Eigen::Index>(c) * data::kCameraParameters));
  }
  return rig;
}

data::TrialReadings HealthTrial::Draw(const Harm& harm, double sigma_px, Rng* rng) const {
  data::TrialReadings out;
  out.path = "made";
  for (const LensCamera& camera : cameras_) out.cameras.push_back(camera.name);
  out.slots = {"m0", "m1", "m2", "m3", data::kDarkSlot};
  out.t = t_;
  for (const int mark : mark_) out.slot.push_back(mark < 0 ? kMarks : mark);
  const std::size_t cameras = cameras_.size();
  out.u_px.assign(t_.size() * cameras, kNone);
  out.s_px = out.u_px;
  for (std::size_t i = 0; i < t_.size(); ++i) {
    for (std::size_t c = 0; c < cameras; ++c) {
      const bool harmed = static_cast<int>(c) == harm.camera && t_[i] >= harm.from;
      const int lag = harmed ? harm.lag : 0;
      const auto from = static_cast<std::ptrdiff_t>(i) - lag;
      if (from < 0 || from >= static_cast<std::ptrdiff_t>(t_.size())) continue;
      const auto line = static_cast<std::size_t>(from);
      double u = true_u_[line * cameras + c];
      if (harmed && !std::isnan(u) && harm.px != 0.0) u = Read(c, place_[line], harm.px);
      if (static_cast<int>(c) == harm.camera) u += harm.per_s * t_[line];
      if (std::isnan(u)) continue;
      out.u_px[i * cameras + c] = u + sigma_px * rng->Normal();
      out.s_px[i * cameras + c] = sigma_px;
    }
  }
  return out;
}

data::TrialReadings HealthTrial::Scattered(int camera, double factor, double sigma_px,
                                           Rng* rng) const {
  data::TrialReadings readings = Draw({}, 0.0, rng);
  const std::size_t cameras = readings.cameras.size();
  for (std::size_t k = 0; k < readings.u_px.size(); ++k) {
    const bool harmed = camera < 0 || static_cast<int>(k % cameras) == camera;
    readings.u_px[k] += (harmed ? factor : 1.0) * sigma_px * rng->Normal();
    if (!std::isnan(readings.u_px[k])) readings.s_px[k] = sigma_px;
  }
  return readings;
}

data::TrialReadings HealthTrial::MarkScattered(int mark, double factor, double sigma_px,
                                               Rng* rng) const {
  data::TrialReadings readings = Draw({}, 0.0, rng);
  const std::size_t cameras = readings.cameras.size();
  for (std::size_t k = 0; k < readings.u_px.size(); ++k) {
    const bool harmed = readings.slot[k / cameras] == mark;
    readings.u_px[k] += (harmed ? factor : 1.0) * sigma_px * rng->Normal();
    if (!std::isnan(readings.u_px[k])) readings.s_px[k] = sigma_px;
  }
  return readings;
}

SampleError ErrorOf(const data::Tracks& tracks, std::size_t i, const Eigen::Vector3d& truth) {
  const auto col = static_cast<Eigen::Index>(i);
  const auto F = tracks.shared.middleCols(col * tracks.shared_rank, tracks.shared_rank);
  return {tracks.p.col(col) - truth, tracks.Covariance(i) + F * F.transpose()};
}

ScatterReport ScatterOf(const data::Rig& rig, const data::TrialReadings& readings,
                        double sigma_px) {
  const std::size_t cameras = readings.cameras.size();
  HealthEvidence evidence(cameras, readings.size());
  std::vector<HealthEvidence::Reading> line(cameras);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    for (std::size_t c = 0; c < cameras; ++c) {
      line[c] = {readings.u_px[i * cameras + c], static_cast<float>(sigma_px)};
    }
    evidence.Add(readings.t[i], readings.slot[i] < kMarks ? readings.slot[i] : -1, line);
  }
  return FindScatter(evidence, Triangulator(rig));
}

}  // namespace unfurl::measure
