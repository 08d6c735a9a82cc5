#pragma once

#include <memory>
#include <string>
#include <vector>

namespace unfurl::data {

// A value with its first and second derivative in time.
struct TimeValue {
  double value = 0.0, rate = 0.0, acceleration = 0.0;
};

// A scalar function of time as a scene gives it: a number, an expression of t, or a table.
// Immutable and cheap to copy; evaluating allocates nothing.
class TimeFunction {
 public:
  TimeFunction() : TimeFunction(0.0) {}  // zero
  explicit TimeFunction(double constant);
  // An expression of t [s], such as "0.3 * sin(2 * pi * t)"; docs/scene.md lists what it may hold.
  // Throws Error with `where`.
  static TimeFunction Expression(const std::string& text, const std::string& where);
  // Through the points: natural cubic spline, or straight lines; constant before and after. Times
  // rise. Throws Error with `where`.
  static TimeFunction Table(std::vector<double> t, std::vector<double> value, bool cubic,
                            const std::string& where);

  TimeValue At(double t) const;
  // The function whose rate this is and that has `start` at t = 0: its value is the integral, to
  // 1e-12 of its range over [0, duration] where this is smooth.
  TimeFunction Integral(double start, double duration) const;
  bool is_constant() const;

  struct Impl;

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace unfurl::data
