#include "tests/measure/light_trial.h"

#include <cmath>
#include <limits>

#include "measure/lens_camera.h"
#include "tests/measure/fixtures.h"
#include "tests/measure/health_trial.h"

namespace unfurl::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Eigen::Vector3d PlaceOf(Course course, int mark, int marks, double share, double t) {
  const double m = mark;
  if (course == Course::kSwing) {
    const double reach = 0.2 + 0.5 * m / marks, rate = 2.0 - 0.3 * m;
    return {reach * std::sin(rate * t + m), 0.8 * reach * std::cos(1.3 * rate * t + m),
            0.5 * std::sin(1.7 * rate * t + 2.0 * m)};
  }
  // A smooth way over the first 80%, then a tremor of 20 mm.
  const double s = std::min(1.0, share / 0.8);
  const double out = s * s * (3.0 - 2.0 * s);
  const double tremor = s < 1.0 ? 0.0 : 0.02 * std::sin(40.0 * t) * std::exp(-3.0 * (share - 0.8));
  return {-0.9 + 0.1 * m / marks + out * (0.3 + 1.4 * (m + 1.0) / marks),
          -0.2 + 0.5 * out * std::sin(m), 0.3 * out * std::cos(2.0 * m) + tremor};
}

// With the pixel's own width and what the silicon adds.
double Width(const SpotLight& spot) {
  constexpr double kSilicon = 0.4;  // [px]
  return std::sqrt(spot.sigma_px * spot.sigma_px + 1.0 / 12.0 + kSilicon * kSilicon);
}

}  // namespace

LightTrial::LightTrial(std::size_t cameras, int marks, int lines, Course course) {
  const data::Lab lab = RingOfCameras(cameras, 2);
  const VirtualRig truth = MakeVirtualRig(lab);
  cameras_ = truth.cameras;
  rig_.volume_low = lab.volume_low;
  rig_.volume_high = lab.volume_high;
  const Eigen::Matrix3Xd points = RandomPoints(lab.volume_low, lab.volume_high, 300, 11);
  for (const LensCamera& camera : truth.cameras) rig_.cameras.push_back(FitCamera(camera, points));
  rig_.model_floor_px = 0.003;
  for (int i = 0; i < lines; ++i) {
    Line line{.t = 1e-3 * (i + 0.5)};
    line.mark = i % (marks + 1) == marks ? -1 : i % (marks + 1);
    line.u.assign(cameras, kNone);
    line.flux = line.width = line.u;
    for (std::size_t c = 0; c < cameras && line.mark >= 0; ++c) {
      const Eigen::Vector3d p =
          PlaceOf(course, line.mark, marks, static_cast<double>(i) / lines, line.t);
      SpotLight spot;
      if (!TraceSpot(truth.cameras[c], p, &spot)) continue;
      const Eigen::Vector3d sight = (rig_.cameras[c].p_WC - p).normalized();
      line.u[c] = spot.centre_px;
      line.flux[c] = 1e9 * spot.flux * sight.z() * sight.z();
      line.width[c] = Width(spot);
      line.place = p;
    }
    lines_.push_back(std::move(line));
  }
}

HealthEvidence LightTrial::Draw(const std::vector<Shade>& shades, Rng* rng) const {
  const std::size_t cameras = rig_.cameras.size();
  HealthEvidence out(cameras, lines_.size());
  std::vector<HealthEvidence::Reading> readings(cameras);
  for (const Line& line : lines_) {
    for (std::size_t c = 0; c < cameras; ++c) {
      readings[c] = {};
      if (std::isnan(line.u[c])) continue;
      double u = line.u[c], flux = line.flux[c], width = line.width[c];
      for (const Shade& shade : shades) {
        if ((shade.camera >= 0 && shade.camera != static_cast<int>(c)) ||
            (shade.mark >= 0 && shade.mark != line.mark) || line.t < shade.from) {
          continue;
        }
        const double done =
            shade.over > 0.0 ? std::min(1.0, (line.t - shade.from) / shade.over) : 1.0;
        (shade.kind == LightKind::kFocus ? width : flux) *= 1.0 + done * shade.share;
      }
      u += 0.03 * rng->Normal();
      flux *= 1.0 + 0.02 * rng->Normal();
      width *= 1.0 + 0.03 * rng->Normal();
      if (rng->Uniform(0.0, 1.0) < 0.02) {
        u = rng->Uniform(0.0, 2159.0);
        flux *= rng->Uniform(0.1, 2.0);
        width *= rng->Uniform(0.5, 3.0);
      }
      readings[c] = {u, 0.03F, static_cast<float>(flux), static_cast<float>(width)};
    }
    out.Add(line.t, line.mark, readings);
  }
  return out;
}

double LightTrial::WidthAt(const Line& line, std::size_t camera, double focus) const {
  LensCamera moved = cameras_[camera];
  moved.sensor.centre.z() -= focus;
  SpotLight spot;
  return TraceSpot(moved, line.place, &spot) ? Width(spot) : kNone;
}

double LightTrial::Blur(std::size_t camera, double focus, double at) const {
  const double around = 0.02 * lines_.back().t;
  double before = 0.0, after = 0.0;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    if (lines_[i].mark < 0 || std::isnan(lines_[i].width[camera]) ||
        std::abs(lines_[i].t - at) > around) {
      continue;
    }
    const double moved = WidthAt(lines_[i], camera, focus);
    before += lines_[i].width[camera] * lines_[i].width[camera];
    after += moved * moved;
  }
  return std::sqrt(after / before) - 1.0;
}

}  // namespace unfurl::measure
