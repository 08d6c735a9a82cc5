#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/dense.h"
#include "base/pose.h"
#include "base/random.h"
#include "base/random_vector.h"
#include "calib/observations.h"
#include "data/lab.h"
#include "measure/lens_camera.h"
#include "measure/triangulate.h"
#include "measure/virtual_rig.h"
#include "tests/calib/synthetic.h"
#include "tests/source_dir.h"

// The shipped laboratory, its mounting errors drawn anew, read by tracing rays through its glass:
// what the fitted model did not make. Spots themselves are left out; readings have normal noise.
namespace unfurl::calib::testing {

// How many laboratories a test tries: the default label's number, or that of the slow one.
constexpr std::size_t Labs([[maybe_unused]] std::size_t quick, [[maybe_unused]] std::size_t slow) {
#ifdef UNFURL_SLOW_TESTS
  return slow;
#else
  return quick;
#endif
}

inline constexpr double kTracedReading = 0.03;  // sigma, what the precise estimator has [px]
inline constexpr double kTracedSurvey = 3e-4;   // per axis [m]
inline constexpr double kTracedHalf = 1.08;     // half a side of the surveyed cube [m]

struct TracedLab {
  measure::VirtualRig truth;
  Rng rng{0};
  double half = kTracedHalf;  // of a side of the surveyed cube [m]
  double survey_sigma = kTracedSurvey, reading_sigma = kTracedReading;

  explicit TracedLab(std::uint64_t seed)
      : truth(measure::MakeVirtualRig(data::ReadLab(
            UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml", {"seed=" + std::to_string(seed)}))),
        rng(seed) {}
  TracedLab(const data::Lab& lab, double half_side, std::uint64_t seed)
      : truth(measure::MakeVirtualRig(lab)), rng(seed), half(half_side) {}

  // Each camera, by some metres and radians an axis.
  void Bump(double metres, double radians) {
    Rng drawn = rng.Stream("bump");
    for (auto& camera : truth.cameras) {
      camera.X_WC.translation() += metres * NormalVector(&drawn);
      const Eigen::Vector3d turn = radians * NormalVector(&drawn);
      camera.X_WC.linear() = camera.X_WC.linear() * RotationFromVector(turn);
    }
  }

  bool Read(std::size_t camera, const Eigen::Vector3d& p, double* u) const {
    measure::SpotLight spot;
    if (!measure::TraceSpot(truth.cameras[camera], p, &spot)) return false;
    *u = spot.centre_px;
    return *u > 10.0 && *u < truth.cameras[camera].sensor.pixels - 11.0;
  }

  Eigen::Matrix3Xd Places(int points) const {
    return PointsInCube(points, half, rng.Stream("places"));
  }
  Observations Survey(int points) const { return Survey(Places(points)); }
  Observations Survey(const Eigen::Matrix3Xd& places) const {
    Observations out;
    out.p = places;
    Rng noise = rng.Stream("noise");
    for (const auto& camera : truth.cameras) {
      out.cameras.push_back(camera.name);
      out.pixels.push_back(camera.sensor.pixels);
    }
    for (Eigen::Index i = 0; i < out.p.cols(); ++i) {
      out.ids.push_back("p" + std::to_string(i + 1));
      out.cov.emplace_back(survey_sigma * survey_sigma * Eigen::Matrix3d::Identity());
      for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
        double u = 0.0;
        if (!Read(c, places.col(i), &u)) continue;
        out.readings.push_back({static_cast<int>(i), static_cast<int>(c),
                                u + reading_sigma * noise.Normal(), reading_sigma});
      }
      for (int k = 0; k < 3; ++k) out.p(k, i) += survey_sigma * noise.Normal();
    }
    return out;
  }
};

// A laboratory of another kind each time: 3 to 8 cameras on a ring of any height, rows of 1000 to
// 6000 pixels, lenses curved in front, behind or on both faces, of any size.
inline data::Lab RandomLab(std::uint64_t seed, double* half_side) {
  data::Lab lab = data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml",
                                {"seed=" + std::to_string(seed)});
  Rng rng = Rng(seed).Stream("kind of laboratory");
  const auto cameras = static_cast<int>(3 + rng.Integer(6));
  const double scale = std::pow(10.0, rng.Uniform(-0.3, 0.3));  // of all distances
  *half_side = scale * kTracedHalf;
  const double height = rng.Uniform(2.4, 3.2), ring = std::sqrt(3.3 * 3.3 - height * height);
  const double from = rng.Uniform(0.0, 2.0 * M_PI);
  lab.cameras.clear();
  for (int j = 0; j < cameras; ++j) {
    data::LabCamera camera;
    camera.name = "camera " + std::to_string(j + 1);
    const double turn = from + 2.0 * M_PI * (j + 0.5) / cameras;
    camera.position = scale * Eigen::Vector3d(ring * std::cos(turn), ring * std::sin(turn), height);
    // Odd numbers of cameras would have two neighbours alike.
    const double lean =
        cameras % 2 == 0 ? (j % 2 == 0 ? 1.0 : -1.0) * M_PI / 4.0 : M_PI * j / cameras - M_PI / 2.0;
    camera.roll = lean + rng.Uniform(-0.1, 0.1);
    lab.cameras.push_back(camera);
  }
  lab.lens.focus_distance *= scale;
  const char* const kFaces[] = {"back", "front", "both"};
  lab.lens.curved = kFaces[rng.Integer(3)];
  if (lab.lens.curved == std::string("both")) lab.lens.radius *= 2.0;  // as strong as one face
  const int row = static_cast<int>(rng.Uniform(1000.0, 6000.0));
  lab.sensor.format.pitch *= 1.0 * lab.sensor.format.active / row;
  lab.sensor.format.active = row;
  return lab;
}

// Errors of points found with noisy readings, and their bound: what the covariance says, of
// calibration and readings. Points that all of the lab's cameras see; of those, `use` read them.
struct TracedErrors {
  std::vector<Eigen::Vector3d> at, error;
  std::vector<double> bound;  // [m^2]

  double Squares() const {
    double sum = 0.0;
    for (const auto& e : error) sum += e.squaredNorm();
    return sum;
  }
  double Bounds() const {
    double sum = 0.0;
    for (const double b : bound) sum += b;
    return sum;
  }
};

inline TracedErrors FindCheckPoints(const TracedLab& lab, const data::Rig& rig, int count,
                                    int lost = -1, double half = kTracedHalf) {
  TracedErrors out;
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  Rng noise = lab.rng.Stream("check noise");
  const auto points = PointsInCube(count, half, lab.rng.Stream("check"));
  const std::size_t cameras = lab.truth.cameras.size();
  std::vector<double> all_u(cameras), u(rig.cameras.size()),
      s(rig.cameras.size(), lab.reading_sigma);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    bool all = true;
    for (std::size_t c = 0; c < cameras; ++c) {
      all = lab.Read(c, points.col(i), &all_u[c]) && all;
      all_u[c] += lab.reading_sigma * noise.Normal();
    }
    if (!all) continue;
    // The rig's cameras by name: it may lack one of the lab's.
    for (std::size_t k = 0; k < rig.cameras.size(); ++k) {
      for (std::size_t c = 0; c < cameras; ++c) {
        if (lab.truth.cameras[c].name == rig.cameras[k].name) u[k] = all_u[c];
      }
    }
    const auto found = triangulator.Solve(u, s, points.col(i), lost < 0 ? ~0U : ~(1U << lost));
    if (found.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(found, s, F);
    out.at.push_back(points.col(i));
    out.error.push_back(found.p - points.col(i));
    out.bound.push_back(found.cov.trace() + F.squaredNorm());
  }
  return out;
}

// Squared errors of found points over their covariance, readings' included, over 3; in the frame of
// the truth, no motion taken off. `squares`: of the distances, on the average [m^2].
inline double NeesOf(const TracedLab& lab, const data::Rig& rig, int count,
                     double* squares = nullptr) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  Rng noise = lab.rng.Stream("check noise");
  const Eigen::Matrix3Xd points = PointsInCube(count, lab.half, lab.rng.Stream("check"));
  std::vector<double> u(rig.cameras.size()), s(rig.cameras.size(), lab.reading_sigma);
  double sum = 0.0, of_distance = 0.0, n = 0.0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    bool all = true;
    for (std::size_t c = 0; c < u.size(); ++c) {
      all = lab.Read(c, points.col(i), &u[c]) && all;
      u[c] += lab.reading_sigma * noise.Normal();
    }
    if (!all) continue;
    const auto found = triangulator.Solve(u, s, points.col(i));
    if (found.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(found, s, F);
    const Eigen::Matrix3d cov = found.cov + F * F.transpose();
    const Eigen::Vector3d e = found.p - points.col(i);
    sum += e.dot(cov.llt().solve(e)) / 3.0;
    of_distance += e.squaredNorm();
    n += 1.0;
  }
  if (squares != nullptr) *squares = of_distance / n;
  return sum / n;
}

}  // namespace unfurl::calib::testing
