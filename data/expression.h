#pragma once

#include <optional>
#include <string>
#include <vector>

#include "data/time_value.h"

namespace unfurl::data {

struct IntervalSeries;

// An expression of the time t [s], such as "0.3 * sin(2 * pi * t)", compiled to a flat program for
// a stack. Numbers, t, pi, e, + - * / ^, signs, parentheses, and the functions of docs/scene.md.
// Evaluating allocates nothing. Why not a library: docs/decisions/009-own-expressions.md.
class Expression {
 public:
  enum class Op : unsigned char {
    kNumber,
    kTime,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kPower,
    kNegate,
    kSin,
    kCos,
    kTan,
    kAsin,
    kAcos,
    kAtan,
    kSinh,
    kCosh,
    kTanh,
    kExp,
    kLog,
    kSqrt,
    kAbs,
    kStep,
    kRamp,
    kSmoothStep,
    kMin,
    kMax
  };
  struct Instruction {
    Op op;
    double number = 0.0;  // of kNumber [unit of the expression]
  };

  // Throws Error with `where` and the column.
  Expression(const std::string& text, const std::string& where);
  // Of a program that is well formed and needs no more than kExpressionDepth.
  explicit Expression(std::vector<Instruction> program);

  double Value(double t) const;
  TimeValue At(double t) const;
  bool is_constant() const;  // t does not occur
  const std::string& text() const { return text_; }

  // Where the expression, or one of its first `derivatives`, is found not to be finite.
  struct Fault {
    double t;            // [s]
    std::string reason;  // "divides by zero"
  };
  // Looks at both ends of [0, duration] and of `cells` equal parts, follows to the spot each step
  // from good to bad, and each divisor that changes its sign or touches zero in between. A pole
  // that shows in none of these passes.
  std::optional<Fault> FindFault(double duration, int derivatives, int cells = 4096) const;

  // Times in (0, duration), rising, where `step`, `ramp`, `smoothstep`, `abs`, `min` and `max`
  // change their branch, each to the nearest double; and places within the rise of a smoothstep,
  // close enough for a method of fifth order to integrate it to 1e-9. Arguments linear in t are
  // solved, however near their edges lie to each other; of others the changes of sign between
  // 4096 equal parts, the edges already found and the stretches that bounds single out are
  // followed to the spot.
  std::vector<double> Edges(double duration) const;

  // Bounds of the value and derivatives up to `order` (IntervalSeries) at all times of [a, b].
  IntervalSeries Bound(double a, double b, int order) const;

 private:
  template <typename T>
  T Run(double t) const;
  std::string Reason(double t) const;
  // What the k-th division divides by, at t.
  double Divisor(int k, double t) const;
  // Whether bounds tell that it is nowhere zero in [a, b].
  bool NeverZero(int k, double a, double b) const;
  // What decides the branch of the instruction at `place`: it changes where this crosses zero.
  double Decider(std::size_t place, double t) const;
  // Of the decider at `place`, or the whole expression where there is no such place; of a division
  // the divisor.
  IntervalSeries BoundOf(std::size_t place, double a, double b, int order) const;
  void AddCrossings(std::size_t place, double level, double duration,
                    std::vector<double>* edges) const;
  // Ends of the stretches of [0, duration] within which the decider crosses `level` at most once.
  std::vector<double> Isolate(std::size_t place, double level, double duration) const;

  std::string text_;
  std::vector<Instruction> program_;
  int divisions_ = 0;
};

}  // namespace unfurl::data
