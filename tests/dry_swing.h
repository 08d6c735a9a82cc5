#pragma once

#include <cmath>
#include <numbers>

namespace unfurl {

// An oscillator with viscous damping and dry friction, in closed form: `rate` is the undamped one
// [rad/s]. Let go at `start`: a decay a, and dry friction that holds within `stuck` of the middle.
// Between two turns the friction is a constant force, so the motion is a damped swing about
// +-stuck.
inline double DrySwing(double t, double rate, double start, double a, double stuck) {
  const double w = std::sqrt(rate * rate - a * a), half = std::numbers::pi / w;
  double from = start;
  for (;; t -= half) {
    const double about = from > 0.0 ? stuck : -stuck;
    if (std::abs(from) <= stuck) return from;
    const auto at = [&](double x) {
      return about +
             (from - about) * std::exp(-a * x) * (std::cos(w * x) + a / w * std::sin(w * x));
    };
    if (t <= half) return at(t);
    from = at(half);
  }
}

}  // namespace unfurl
