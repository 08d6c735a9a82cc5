#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "correlate/model.h"

namespace unfurl::correlate {

// Which law the stops of a latch obey. The first is the simulator's; the others are other people's,
// with the same stiffness where they have one.
enum class StopLaw {
  kScene,         // K d^1.5 + C T(d) d', held at 0: docs/physics-simulator.md, "Contact"
  kHuntCrossley,  // K d^1.5 (1 + 3/2 a d'): loses less in slow impacts, where the first loses more
  kKelvinVoigt,   // k d + c d', held at 0: a linear spring and dashpot
  kNewton,        // rigid: rate reversed at once, times a coefficient of restitution
};

// The latching pendulum of data/sets/bouncing_latch, written a second time as one equation in one
// angle and integrated by Runge-Kutta 4 at a fixed step, with any of these laws. Parameters as
// Pendulum's: clearance [rad], restitution, damping of the hinge [N m s/rad], stiffness of the
// spring [N m/rad]. `restitution` is the scene's key under kScene, and what comes back of an impact
// at `kSpeed` under the others.
class OneArm : public Model {
 public:
  explicit OneArm(StopLaw law) : law_(law) {}

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    double last = 0.0;
    for (const auto& list : stamps.t) last = std::max(last, list.empty() ? 0.0 : list.back());
    const std::vector<State> motion = Integrate(theta, last + 2.0 * kStep);
    Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      const double radius = stamps.marks[m] == "tip" ? 2.0 * kArm : kArm;
      MarkMotion marks;
      const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
      marks.p.setZero(3, n);
      marks.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        State s = motion.front();
        if (t > 0.0) {
          const auto k = std::min(static_cast<std::size_t>(t / kStep), motion.size() - 2);
          const double u = t / kStep - static_cast<double>(k);
          // Linear between steps of 10 us: what it is off by is far below a nanometre.
          s.angle = (1 - u) * motion[k].angle + u * motion[k + 1].angle;
          s.rate = (1 - u) * motion[k].rate + u * motion[k + 1].rate;
        }
        const double c = std::cos(s.angle), d = std::sin(s.angle);
        marks.p.col(i) << radius * c, radius * d, 0.0;
        if (t > 0.0) marks.v.col(i) << -radius * d * s.rate, radius * c * s.rate, 0.0;
      }
      out.marks.push_back(std::move(marks));
    }
    return out;
  }

 private:
  struct State {
    double angle = 0.0, rate = 0.0;
  };
  static constexpr double kStep = 1e-5;  // [s]; an impact lasts some milliseconds
  static constexpr double kArm = 0.4;    // of the middle from the pivot [m]
  static constexpr double kInertia = 0.0226133333333333 + 0.424 * kArm * kArm;
  static constexpr double kPreload = 1.57, kLever = 0.02;  // [rad, m]
  static constexpr double kSpeed = 0.03;  // of the faces, half of the first impact's [m/s]
  static constexpr double kDepth = 1e-4;  // at which the linear spring is as stiff as Hertz's [m]

  // Of one stop [N], from depth [m] and its rate [m/s].
  double Force(double d, double rate, double restitution) const {
    if (d <= 0.0) return 0.0;
    constexpr double kPi = std::numbers::pi;
    const double h = 0.91 / kPi * (1.0 / 2.01e11 + 1.0 / 6.895e10);
    const double K = 4.0 / (3.0 * kPi * h) * std::sqrt(0.005);
    if (law_ == StopLaw::kHuntCrossley) {
      const double a = (1.0 - restitution) / kSpeed;
      return std::max(0.0, K * std::pow(d, 1.5) * (1.0 + 1.5 * a * rate));
    }
    const double log_e = std::log(restitution);
    const double part = std::sqrt(log_e * log_e / (log_e * log_e + kPi * kPi));
    if (law_ == StopLaw::kKelvinVoigt) {
      const double mass = kInertia / (kLever * kLever), k = K * std::sqrt(kDepth);
      return std::max(0.0, k * d + 2.0 * part * std::sqrt(k * mass) * rate);
    }
    constexpr double kMass = 0.424, kLinear = 3.2e9, kShape = 3.0, kZone = 5e-6;
    const double C = 2.0 * std::sqrt(kLinear * kMass) * part;
    const double T = d < kZone ? std::exp(2.0 * (d - kZone) * kShape / kZone) : 1.0;
    return std::max(0.0, K * std::pow(d, 1.5) + C * T * rate);
  }

  std::vector<State> Integrate(std::span<const double> theta, double end) const {
    const double clearance = theta[0], e = theta[1], damping = theta[2], stiffness = theta[3];
    bool latched = false;
    auto acceleration = [&](const State& s) {
      double moment = -stiffness * (s.angle + kPreload) - damping * s.rate;
      if (law_ != StopLaw::kNewton) {
        const double rate = kLever * s.rate;
        if (latched) moment -= kLever * Force(kLever * (s.angle - clearance), rate, e);
        moment += kLever * Force(kLever * (-s.angle - clearance), -rate, e);
      }
      return moment / kInertia;
    };
    State s{std::numbers::pi / 2.0, 0.0};
    std::vector<State> out;
    const auto steps = static_cast<std::size_t>(std::ceil(end / kStep)) + 1;
    out.reserve(steps + 1);
    for (std::size_t i = 0; i <= steps; ++i) {
      out.push_back(s);
      const State a{s.rate, acceleration(s)};
      const State b = Derivative(s, a, 0.5, acceleration);
      const State c = Derivative(s, b, 0.5, acceleration);
      const State d = Derivative(s, c, 1.0, acceleration);
      const State before = s;
      s.angle += kStep / 6.0 * (a.angle + 2.0 * b.angle + 2.0 * c.angle + d.angle);
      s.rate += kStep / 6.0 * (a.rate + 2.0 * b.rate + 2.0 * c.rate + d.rate);
      if (law_ == StopLaw::kNewton) Reflect(before, latched, clearance, e, &s);
      latched = latched || s.angle < clearance;
    }
    return out;
  }

  template <class F>
  static State Derivative(const State& s, const State& slope, double part, const F& acceleration) {
    const State at{s.angle + part * kStep * slope.angle, s.rate + part * kStep * slope.rate};
    return {at.rate, acceleration(at)};
  }

  // A rigid stop passed within the step: the angle's overshoot and the rate turned back.
  static void Reflect(const State& before, bool latched, double clearance, double e, State* s) {
    if (before.angle > -clearance && s->angle <= -clearance) {
      s->angle = -clearance + e * (-clearance - s->angle);
      s->rate = -e * s->rate;
    } else if (latched && before.angle < clearance && s->angle >= clearance) {
      s->angle = clearance - e * (s->angle - clearance);
      s->rate = -e * s->rate;
    }
  }

  StopLaw law_;
};

}  // namespace unfurl::correlate
