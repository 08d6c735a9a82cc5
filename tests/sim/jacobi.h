#pragma once

#include <cmath>

namespace unfurl::sim {

// Amplitude am(u | k) of Jacobi's elliptic functions by the arithmetic-geometric mean (Abramowitz
// and Stegun 16.4); 0 <= k < 1.
inline double JacobiAmplitude(double u, double k) {
  constexpr int kLevels = 12;  // the means agree to rounding after some six
  double a[kLevels + 1], c[kLevels + 1], b = std::sqrt(1.0 - k * k);
  a[0] = 1.0;
  c[0] = k;
  for (int i = 0; i < kLevels; ++i) {
    a[i + 1] = 0.5 * (a[i] + b);
    c[i + 1] = 0.5 * (a[i] - b);
    b = std::sqrt(a[i] * b);
  }
  double phi = std::ldexp(a[kLevels] * u, kLevels);
  for (int i = kLevels; i > 0; --i) phi = 0.5 * (phi + std::asin(c[i] / a[i] * std::sin(phi)));
  return phi;
}

// Angle and rate at time t of a pendulum released at rest at theta0: with k = sin(theta0 / 2) and
// omega its small frequency, sin(theta / 2) = k sn(K(k) - omega t | k).
inline void PendulumAt(double t, double theta0, double omega, double* theta, double* rate) {
  const double k = std::sin(0.5 * theta0);
  const double phi = JacobiAmplitude(std::comp_ellint_1(k) - omega * t, k);
  *theta = 2.0 * std::asin(k * std::sin(phi));
  *rate = -2.0 * omega * k * std::cos(phi);
}

}  // namespace unfurl::sim
