#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::data {

// Bounds of a number. Not rounded outwards: they are for features far larger than rounding. Nothing
// overflows: what lies beyond kUnbounded is taken for that.
inline constexpr double kUnbounded = 1e150;  // its square is still a double [-]

struct Interval {
  double low = 0.0, high = 0.0;

  double Width() const { return high - low; }
  double Magnitude() const { return std::max(std::fabs(low), std::fabs(high)); }
  bool Holds(double x) const { return low <= x && x <= high; }
  bool IsNumber() const { return low == high; }
};

inline constexpr Interval kEverything{-kUnbounded, kUnbounded};

inline Interval Clamped(double low, double high) {
  return {std::clamp(low, -kUnbounded, kUnbounded), std::clamp(high, -kUnbounded, kUnbounded)};
}
inline Interval Hull(const Interval& u, const Interval& v) {
  return {std::min(u.low, v.low), std::max(u.high, v.high)};
}

inline Interval operator-(const Interval& u) { return {-u.high, -u.low}; }
inline Interval operator+(const Interval& u, const Interval& v) {
  return Clamped(u.low + v.low, u.high + v.high);
}
inline Interval operator-(const Interval& u, const Interval& v) {
  return Clamped(u.low - v.high, u.high - v.low);
}
inline Interval operator*(const Interval& u, const Interval& v) {
  const double a = u.low * v.low, b = u.low * v.high, c = u.high * v.low, d = u.high * v.high;
  return Clamped(std::min(std::min(a, b), std::min(c, d)),
                 std::max(std::max(a, b), std::max(c, d)));
}
inline Interval operator*(double s, const Interval& u) {
  return s < 0.0 ? Clamped(s * u.high, s * u.low) : Clamped(s * u.low, s * u.high);
}
// Or next to zero.
inline bool MayBeZero(const Interval& u) {
  return u.low < 1.0 / kUnbounded && u.high > -1.0 / kUnbounded;
}
// Everything, where the divisor may be zero.
inline Interval operator/(const Interval& u, const Interval& v) {
  if (MayBeZero(v)) return kEverything;
  return u * Interval{1.0 / v.high, 1.0 / v.low};
}

inline Interval Exp(const Interval& u) {
  constexpr double kLeast = -700.0, kMost = 345.0;  // of exponents: 1e-304 and kUnbounded
  const auto at = [](double x) { return x < kLeast ? 0.0 : x > kMost ? kUnbounded : std::exp(x); };
  return {at(u.low), at(u.high)};
}

// Of a sine; that of a cosine is the sine of u + pi / 2.
inline Interval Sin(const Interval& u) {
  // A period, and where the first top is [rad]; beyond the largest a double holds no phase.
  constexpr double kTurn = 2.0 * std::numbers::pi, kTop = 0.5 * std::numbers::pi, kMost = 1e15;
  if (!(u.Width() < kTurn) || u.Magnitude() > kMost) return {-1.0, 1.0};
  const double a = std::sin(u.low), b = std::sin(u.high);
  const auto passes = [&](double place) {
    return std::floor((u.high - place) / kTurn) > std::floor((u.low - place) / kTurn);
  };
  return {passes(-kTop) ? -1.0 : std::min(a, b), passes(kTop) ? 1.0 : std::max(a, b)};
}

}  // namespace unfurl::data
