#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/random.h"
#include "correlate/model.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

// A planar two-link arm on a swinging base, in closed form, held until t = 0: the first link swings
// as a damped cosine, the second turns beside it. Parameters: frequency [Hz] and decay [1/s] of the
// first link. Marks: `base` and `base2` on one rigid body, `elbow`, `tip`.
class TwoLink : public Model {
 public:
  static std::vector<std::string> Marks() { return {"base", "base2", "elbow", "tip"}; }
  static std::vector<double> Truth() { return {0.9, 0.35}; }

  double noise = 0.0;  // what it reports

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    out.noise = noise;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
      motion.p.setZero(3, n);
      motion.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        constexpr double kStep = 1e-6;
        motion.p.col(i) = Position(theta, stamps.marks[m], std::max(t, 0.0));
        if (t >= 0.0) {
          motion.v.col(i) = (Position(theta, stamps.marks[m], t + kStep) -
                             Position(theta, stamps.marks[m], std::max(0.0, t - kStep))) /
                            (t + kStep - std::max(0.0, t - kStep));
        }
      }
      out.marks.push_back(std::move(motion));
    }
    return out;
  }

  static Eigen::Vector3d Position(std::span<const double> theta, const std::string& mark,
                                  double t) {
    constexpr double kPi = std::numbers::pi;
    const double w = 2.0 * kPi * theta[0];
    const double turn = 0.05 * std::sin(2.0 * kPi * 0.4 * t);
    const double q1 = 1.2 * std::exp(-theta[1] * t) * std::cos(w * t);
    const double q2 = q1 + 0.8 * (1.0 - std::exp(-2.0 * t)) + 0.1 * (1.0 - std::cos(7.0 * t));
    auto along = [](double a, double length) {
      return Eigen::Vector3d(length * std::cos(a), length * std::sin(a), 0.0);
    };
    if (mark == "base") return along(turn, -0.16);
    if (mark == "base2") return along(turn, 0.16);
    const Eigen::Vector3d elbow = along(turn, 0.2) + along(q1, 0.8);
    return mark == "elbow" ? elbow : Eigen::Vector3d(elbow + along(q2, 0.8));
  }
};

// A trial of any model: strobed marks, a frame, a clock that is off, noise.
struct Trial {
  Pose X_WM = Pose::Identity();
  double offset = 0.0;       // [s]
  double duration = 4.0;     // on the model's clock [s]
  double before = 0.1;       // recorded before the model starts [s]
  double step = 0.005;       // per mark [s]
  double sigma = 2e-4;       // per axis [m]
  double rho = 0.0;          // correlation of one mark's errors from sample to sample
  double across = 0.0;       // amplitude of a motion out of the plane, at 3 Hz [m]
  int shared_rank = 0;       // errors common to all samples: smooth maps of position
  double shared_size = 0.0;  // their size [m]
};

inline Trial TiltedTrial() {
  Trial trial;
  trial.X_WM.linear() = RotationFromVector({0.4, -0.9, 1.7});
  trial.X_WM.translation() = Eigen::Vector3d(12.0, -3.5, 1.25);
  trial.offset = 0.7312;
  return trial;
}

inline Observations Record(const Model& model, std::span<const double> theta,
                           const std::vector<std::string>& marks, const Trial& trial, Rng& rng) {
  Stamps stamps;
  stamps.marks = marks;
  const double slot = trial.step / static_cast<double>(marks.size() + 1);
  for (std::size_t m = 0; m < marks.size(); ++m) {
    std::vector<double> t;
    for (double s = -trial.before + slot * static_cast<double>(m); s <= trial.duration;
         s += trial.step) {
      t.push_back(s);
    }
    stamps.t.push_back(std::move(t));
  }
  const Prediction truth = model.Evaluate(theta, stamps);
  const int k = trial.shared_rank;
  Eigen::VectorXd z(k);
  for (int j = 0; j < k; ++j) z(j) = rng.Normal();
  Observations out;
  out.shared_rank = k;
  out.frame = "rig";
  for (std::size_t m = 0; m < marks.size(); ++m) {
    MarkSeries series;
    series.name = marks[m];
    const Eigen::Index n = truth.marks[m].p.cols();
    series.p.resize(3, n);
    series.cov.resize(6, n);
    series.shared.setZero(3, n * k);
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = stamps.t[m][static_cast<std::size_t>(i)];
      for (int axis = 0; axis < 3; ++axis) {
        const double fresh = rng.Normal();
        error(axis) =
            i == 0 ? fresh
                   : trial.rho * error(axis) + std::sqrt(1.0 - trial.rho * trial.rho) * fresh;
      }
      Eigen::Vector3d y = truth.marks[m].p.col(i);
      y.z() += trial.across * std::sin(2.0 * std::numbers::pi * 3.0 * t);
      series.p.col(i) = trial.X_WM * y + trial.sigma * error;
      for (int j = 0; j < k; ++j) {
        series.shared.col(i * k + j) =
            trial.shared_size *
            Eigen::Vector3d(std::sin(y.x() * (1 + j)), std::cos(2 * y.y() + j), y.x() * y.y());
        series.p.col(i) += series.shared.col(i * k + j) * z(j);
      }
      const double v = trial.sigma * trial.sigma;
      series.cov.col(i) << v, 0.0, 0.0, v, 0.0, v;
      series.t.push_back(t + trial.offset);
    }
    out.marks.push_back(std::move(series));
  }
  return out;
}

}  // namespace unfurl::correlate
