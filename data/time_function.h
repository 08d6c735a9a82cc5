#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "data/time_value.h"

namespace unfurl::data {

struct FunctionScan;

// A scalar function of time as a scene gives it: a number, an expression of t, or a table.
// Immutable and cheap to copy; evaluating allocates nothing.
class TimeFunction {
 public:
  TimeFunction() : TimeFunction(0.0) {}  // zero
  // The same value at all times.
  explicit TimeFunction(double constant);
  // An expression of t [s], such as "0.3 * sin(2 * pi * t)"; docs/scene.md lists what it may hold.
  // Throws Error with `where`.
  static TimeFunction Expression(const std::string& text, const std::string& where);
  // Through the points: natural cubic spline, or straight lines; constant before and after. Times
  // rise. Throws Error with `where`.
  static TimeFunction Table(std::vector<double> t, std::vector<double> value, bool cubic,
                            const std::string& where);

  // Value and first two time derivatives at t [s].
  TimeValue At(double t) const;
  double Value(double t) const;  // the same, without derivatives
  // The function whose rate this is and that has `start` at t = 0: its value is the integral, to
  // 1e-12 of its range over [0, duration] where this is smooth. Throws Error when that takes too
  // many pieces.
  TimeFunction Integral(double start, double duration) const;
  bool is_constant() const;

  // Throws Error when the function, or one of its first `derivatives`, is found not to be finite
  // somewhere in [0, duration]; Expression::FindFault says what is found. `cells`: how closely to
  // look.
  void CheckFinite(double duration, int derivatives, int cells = 4096) const;
  // Finite at t?
  bool IsFinite(double t, int derivatives) const;
  // Times in (0, duration), rising, where the function or a derivative may jump: knots of tables,
  // and Expression::Edges.
  std::vector<double> Edges(double duration) const;
  // The first of them where the value itself jumps.
  std::optional<double> FindJump(double duration) const;
  // The function, or one of its first two derivatives, bounded at all times of [a, b].
  struct Bounds {
    double low, high;  // of the values [unit]
    double fourth;     // largest magnitude of the fourth derivative of that [unit/s^4]
  };
  // None of tables: between their knots they hold nothing that is not seen.
  std::optional<Bounds> Bound(double a, double b, int derivative) const;
  // Looked through for features that samples would miss (data/function_scan.h): cells of
  // [0, duration] are halved until none may hide more than `part` of the area, or there are `most`.
  FunctionScan Scan(int derivative, double duration, double part, std::size_t most) const;
  // `"1 / (t - 0.3)" (scene.toml:12:joint.a.motor.moment)`, for messages.
  std::string Describe() const;

  struct Impl;

 private:
  explicit TimeFunction(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

}  // namespace unfurl::data
