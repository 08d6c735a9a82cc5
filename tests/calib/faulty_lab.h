#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "measure/triangulate.h"
#include "tests/calib/synthetic.h"
#include "tests/calib/traced.h"

// A laboratory of any kind, read by rays through its glass, with one fault of any size: what a
// verdict "good" is held against.
namespace unfurl::calib::testing {

enum class Fault {
  kNone,
  kDrift,        // one camera's readings drift: a ramp, a step, an exponential
  kAllDrift,     // those of all cameras together, by sizes of their own
  kPattern,      // ripples over the row, of one camera or all
  kCorner,       // the survey is confined to a corner
  kSinking,      // the tripod sinks while it measures
  kSetUps,       // a second set-up that nobody names, beyond a plane: off by a shift
  kMoved,        // the station is knocked in mid-survey: a shift and a turn from a point on
  kNoise,        // readings or places scatter more than they state
  kTemperature,  // image scale and offset of all cameras creep to new values
  kScale,        // some points were measured with another scale of the distances
  kMixed,        // some readings are of fewer shots than they state
  kWalls,        // the survey is on three walls
};
inline constexpr std::size_t kFaults = 12;
inline const char* NameOf(Fault fault) {
  constexpr const char* kNames[] = {"none",    "drift",   "all-drift", "pattern", "corner",
                                    "sinking", "set-ups", "moved",     "noise",   "temperature",
                                    "scale",   "mixed",   "walls"};
  return kNames[static_cast<int>(fault)];
}

// In which order the points were measured.
enum class SurveyOrder { kRandom, kAlong, kLayers };

class FaultyLab {
 public:
  static constexpr int kPoints = 200;

  FaultyLab(std::uint64_t seed, Fault fault) : fault_(fault), lab_(Make(seed, &half_)) {
    Rng rng = lab_.rng.Stream("wrong model");
    lab_.reading_sigma = std::pow(10.0, rng.Uniform(-2.0, -1.2));
    // From a third of a sigma, of readings or survey, to a hundred.
    sigmas_ = std::pow(10.0, rng.Uniform(-0.5, 2.0));
    shape_ = static_cast<int>(rng.Integer(3));
    period_ = rng.Uniform(0.03, 1.0);
    phase_ = rng.Uniform(0.0, 2.0 * M_PI);
    step_ = rng.Uniform(0.2, 0.8);
    bad_ = rng.Integer(lab_.truth.cameras.size());
    all_ = rng.Uniform() < 0.3;
    share_ = rng.Uniform(0.1, 0.45);
    for (double& x : corner_) x = rng.Uniform() < 0.5 ? -1.0 : 1.0;
    // A survey without a fault is measured in any order that does not go with its places.
    const auto order = static_cast<SurveyOrder>(rng.Integer(3));
    order_ = fault == Fault::kNone ? SurveyOrder::kRandom : order;
    for (double& x : way_) x = rng.Normal();
    way_.normalize();
    for (double& x : turn_) x = rng.Normal();
    turn_.normalize();
    for (std::size_t c = 0; c < lab_.truth.cameras.size(); ++c) of_camera_.push_back(rng.Normal());
  }
  // The order of measuring is that of a faultless survey, but along its places.
  void MeasureAlong() { order_ = SurveyOrder::kAlong; }

  Observations Survey() const {
    Eigen::Matrix3Xd places = Places();
    Observations data = lab_.Survey(places);
    for (Reading& r : data.readings) {
      r.u_px += Error(static_cast<std::size_t>(r.camera), r.u_px, (r.point + 0.5) / kPoints);
    }
    MoveStation(places, &data);
    if (fault_ == Fault::kNoise) StateLess(&data);
    if (fault_ == Fault::kMixed) MixShots(&data);
    return data;
  }

  std::string Words() const {
    constexpr const char* kOrders[] = {"any order", "along", "layers"};
    char text[160];
    std::snprintf(text, sizeof text,
                  "%zu cameras, reading %.3f px, %.2f sigmas, shape %d, period %.2f, %s, share "
                  "%.2f, %s",
                  lab_.truth.cameras.size(), lab_.reading_sigma, sigmas_, shape_, period_,
                  all_ ? "all" : "one", share_, kOrders[static_cast<int>(order_)]);
    return text;
  }

  // Squared errors of points that three cameras or more see, read as after the survey, over their
  // whole covariance, over 3. What a station does to all points as one rigid motion is where the
  // frame is: of its faults the rest counts.
  double NeesOf(const data::Rig& rig) const {
    const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
    Eigen::Matrix3Xd F(3, triangulator.shared_rank());
    Rng noise = lab_.rng.Stream("held-out noise");
    const Eigen::Matrix3Xd points = PointsInCube(200, half_, lab_.rng.Stream("held out"));
    std::vector<double> u(rig.cameras.size()), s(rig.cameras.size(), lab_.reading_sigma);
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    double sum = 0.0, n = 0.0;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      std::size_t seen = 0;
      for (std::size_t c = 0; c < u.size(); ++c) {
        const double by = noise.Normal();
        if (lab_.Read(c, points.col(i), &u[c])) {
          u[c] += Error(c, u[c], 1.0) + lab_.reading_sigma * by;
          ++seen;
        } else {
          u[c] = std::numeric_limits<double>::quiet_NaN();
        }
      }
      if (seen < 3) continue;
      const auto found = triangulator.Solve(u, s, points.col(i));
      if (found.outcome != measure::PointOutcome::kSolved) continue;
      triangulator.SharedFactor(found, s, F);
      const Eigen::Matrix3d cov = found.cov + F * F.transpose();
      const Eigen::Vector3d e = found.p - points.col(i);
      sum += e.dot(cov.llt().solve(e)) / 3.0;
      n += 1.0;
      Eigen::Matrix<double, 3, 6> A = Eigen::Matrix<double, 3, 6>::Identity();
      for (int k = 0; k < 3; ++k) {
        A.col(3 + k) = Eigen::Vector3d::Unit(k).cross(Eigen::Vector3d(points.col(i)));
      }
      const Eigen::Matrix<double, 3, 6> WA = cov.llt().solve(A);
      H += A.transpose() * WA;
      g += WA.transpose() * e;
    }
    const bool station = fault_ == Fault::kSinking || fault_ == Fault::kSetUps ||
                         fault_ == Fault::kMoved || fault_ == Fault::kScale;
    if (station) sum -= g.dot(H.llt().solve(g)) / 3.0;
    return n > 0.0 ? sum / n : 0.0;
  }

 private:
  static TracedLab Make(std::uint64_t seed, double* half) {
    const data::Lab kind = RandomLab(seed, half);
    return {kind, *half, seed};
  }

  // What is added to a reading at a time of the survey from 0 to 1.
  double Error(std::size_t camera, double u_px, double t) const {
    const double size = lab_.reading_sigma * sigmas_;
    const double row = lab_.truth.cameras[camera].sensor.pixels;
    const double course[] = {t, t > step_ ? 1.0 : 0.0, 1.0 - std::exp(-5.0 * t)};
    switch (fault_) {
      case Fault::kDrift:
        return camera == bad_ ? size * course[shape_] : 0.0;
      case Fault::kAllDrift:
        return size * course[shape_] * of_camera_[camera];
      case Fault::kTemperature:
        return size * course[2] * (std::cos(phase_) * (2.0 * u_px / row - 1.0) + std::sin(phase_)) *
               (all_ ? 1.0 : of_camera_[camera]);
      case Fault::kPattern:
        if (!all_ && camera != bad_) return 0.0;
        return size *
               std::sin(2.0 * M_PI * u_px / (period_ * row) + phase_ + static_cast<double>(camera));
      default:
        return 0.0;
    }
  }

  Eigen::Matrix3Xd Places() const {
    Eigen::Matrix3Xd places = lab_.Places(kPoints);
    if (fault_ == Fault::kCorner) {
      places = (share_ * places).colwise() + (1.0 - share_) * half_ * corner_;
    }
    for (int i = 0; fault_ == Fault::kWalls && i < kPoints; ++i) {
      places(i % 3, i) = half_ * corner_(i % 3);
    }
    std::vector<double> key(kPoints);
    for (int i = 0; i < kPoints; ++i) {
      key[static_cast<std::size_t>(i)] = way_.dot(places.col(i));
      if (order_ == SurveyOrder::kLayers) {
        const double layer = std::floor(5.0 * (places(shape_, i) / half_ + 1.0) / 2.0);
        key[static_cast<std::size_t>(i)] = 100.0 * layer + places((shape_ + 1) % 3, i);
      }
    }
    std::vector<Eigen::Index> order(kPoints);
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    if (order_ != SurveyOrder::kRandom) {
      std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
        return key[static_cast<std::size_t>(a)] < key[static_cast<std::size_t>(b)];
      });
    }
    return places(Eigen::all, order);
  }

  // What the station does wrong, by as many sigmas of a point as readings are off otherwise.
  void MoveStation(const Eigen::Matrix3Xd& places, Observations* data) const {
    const double size = lab_.survey_sigma * sigmas_;
    for (Eigen::Index i = 0; i < data->p.cols(); ++i) {
      const double t = (static_cast<double>(i) + 0.5) / kPoints;
      const Eigen::Vector3d p = places.col(i);
      if (fault_ == Fault::kSinking) {
        data->p(2, i) += size * (t - 1.0);
      } else if (fault_ == Fault::kSetUps && p.dot(way_) > (step_ - 0.5) * half_) {
        data->p.col(i) += size * turn_;
      } else if (fault_ == Fault::kMoved && t > step_) {
        data->p.col(i) += size * (turn_ + corner_.cross(p) / half_) / std::sqrt(3.0);
      } else if (fault_ == Fault::kScale && (all_ ? t > step_ : p.dot(way_) > 0.0)) {
        data->p.col(i) += size * p / half_;
      }
    }
  }
  // Readings, or places, scatter more than they state: by up to three times.
  void StateLess(Observations* data) const {
    const double factor = 1.0 + 2.0 * step_;
    if (shape_ != 1) {
      for (Reading& r : data->readings) {
        if (all_ || r.camera == static_cast<int>(bad_)) r.s_px /= factor;
      }
    }
    if (shape_ == 0) return;
    for (Eigen::Matrix3d& cov : data->cov) cov /= factor * factor;
  }
  // A share of the readings, of one camera or all, scatters as single shots do.
  void MixShots(Observations* data) const {
    Rng rng = lab_.rng.Stream("shots");
    for (Reading& r : data->readings) {
      const bool single = rng.Uniform() < share_;
      const double by = lab_.reading_sigma * sigmas_ * rng.Normal();
      if (single && (all_ || r.camera == static_cast<int>(bad_))) r.u_px += by;
    }
  }

  Fault fault_;
  double half_ = 0.0;
  TracedLab lab_;
  double sigmas_ = 0.0, period_ = 1.0, phase_ = 0.0, step_ = 0.5, share_ = 1.0;
  int shape_ = 0;
  std::size_t bad_ = 0;
  bool all_ = false;
  SurveyOrder order_ = SurveyOrder::kRandom;
  Eigen::Vector3d corner_ = Eigen::Vector3d::Ones(), way_ = corner_, turn_ = corner_;
  std::vector<double> of_camera_;
};

}  // namespace unfurl::calib::testing
