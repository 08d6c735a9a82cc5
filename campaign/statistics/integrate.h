#pragma once

#include <cmath>
#include <numbers>

namespace unfurl::campaign {

/// The integral of f over (a, b) by the double exponential rule [Takahasi and Mori 1974], which
/// neither end's singularity disturbs. f gets the distances (x - a, b - x), so that it can keep
/// the digits of an x near either end; some 1e-12 of the integral for what is smooth inside.
template <typename F>
double Integrate(double a, double b, const F& f) {
  if (!(b > a)) return 0.0;
  // Step and range of the transformed variable: the ends are 1e-300 of the interval away.
  constexpr double kStep = 1.0 / 32.0;
  constexpr int kSteps = 192;
  double sum = 0.0;
  for (int i = -kSteps; i <= kSteps; ++i) {
    const double t = kStep * i;
    const double s = std::numbers::pi / 2.0 * std::sinh(t);
    const double near = 1.0 / (1.0 + std::exp(2.0 * std::abs(s)));  // share to the nearer end
    const double weight = std::numbers::pi * std::cosh(t) * near * (1.0 - near);
    const double to_near = near * (b - a), to_far = (1.0 - near) * (b - a);
    if (!(to_near > 0.0) || !(weight > 0.0)) continue;
    sum += weight * (t < 0.0 ? f(to_near, to_far) : f(to_far, to_near));
  }
  return sum * kStep * (b - a);
}

}  // namespace unfurl::campaign
