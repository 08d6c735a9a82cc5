#pragma once

namespace unfurl::data {

// A value with its first and second derivative in time: forward differentiation, exact to rounding.
struct TimeValue {
  double value = 0.0, rate = 0.0, acceleration = 0.0;  // [unit], [unit/s], [unit/s^2]
};

// f(u) from f, f' and f'' at u's value.
constexpr TimeValue Chain(const TimeValue& u, double f, double f1, double f2) {
  return {f, f1 * u.rate, f2 * u.rate * u.rate + f1 * u.acceleration};
}

constexpr TimeValue operator-(const TimeValue& u) { return {-u.value, -u.rate, -u.acceleration}; }
constexpr TimeValue operator+(const TimeValue& u, const TimeValue& v) {
  return {u.value + v.value, u.rate + v.rate, u.acceleration + v.acceleration};
}
constexpr TimeValue operator-(const TimeValue& u, const TimeValue& v) {
  return {u.value - v.value, u.rate - v.rate, u.acceleration - v.acceleration};
}
constexpr TimeValue operator*(const TimeValue& u, const TimeValue& v) {
  return {u.value * v.value, u.rate * v.value + u.value * v.rate,
          u.acceleration * v.value + 2.0 * u.rate * v.rate + u.value * v.acceleration};
}
constexpr TimeValue operator/(const TimeValue& u, const TimeValue& v) {
  const double q = u.value / v.value;
  const double rate = (u.rate - q * v.rate) / v.value;
  return {q, rate, (u.acceleration - 2.0 * rate * v.rate - q * v.acceleration) / v.value};
}

}  // namespace unfurl::data
