#pragma once

#include <cmath>

#include "data/expression.h"

namespace unfurl::data {

// The operations of an expression's program on numbers; private to it.

inline int OperandsOf(Expression::Op op) {
  using Op = Expression::Op;
  switch (op) {
    case Op::kNumber:
    case Op::kTime:
      return 0;
    case Op::kAdd:
    case Op::kSubtract:
    case Op::kMultiply:
    case Op::kDivide:
    case Op::kPower:
    case Op::kMin:
    case Op::kMax:
      return 2;
    default:
      return 1;
  }
}

// Quintic that joins 0 and 1 with two continuous derivatives.
inline double SmoothStep(double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

inline double ApplyUnary(Expression::Op op, double x) {
  using Op = Expression::Op;
  switch (op) {
    case Op::kNegate:
      return -x;
    case Op::kSin:
      return std::sin(x);
    case Op::kCos:
      return std::cos(x);
    case Op::kTan:
      return std::tan(x);
    case Op::kAsin:
      return std::asin(x);
    case Op::kAcos:
      return std::acos(x);
    case Op::kAtan:
      return std::atan(x);
    case Op::kSinh:
      return std::sinh(x);
    case Op::kCosh:
      return std::cosh(x);
    case Op::kTanh:
      return std::tanh(x);
    case Op::kExp:
      return std::exp(x);
    case Op::kLog:
      return std::log(x);
    case Op::kSqrt:
      return std::sqrt(x);
    case Op::kAbs:
      return std::fabs(x);
    case Op::kStep:
      return x < 0.0 ? 0.0 : 1.0;
    case Op::kRamp:
      return x < 0.0 ? 0.0 : x;
    default:
      return SmoothStep(x);
  }
}

inline double Power(double u, double v) { return std::pow(u, v); }
TimeValue Power(const TimeValue& u, const TimeValue& v);
inline double ValueOf(double v) { return v; }
inline double ValueOf(const TimeValue& v) { return v.value; }

// T: double or TimeValue.
template <typename T>
T ApplyBinary(Expression::Op op, const T& u, const T& v) {
  using Op = Expression::Op;
  switch (op) {
    case Op::kAdd:
      return u + v;
    case Op::kSubtract:
      return u - v;
    case Op::kMultiply:
      return u * v;
    case Op::kDivide:
      return u / v;
    case Op::kPower:
      return Power(u, v);
    // What is no number is neither: it is told, whichever side it stands on.
    case Op::kMin:
      return ValueOf(v) < ValueOf(u) || std::isnan(ValueOf(v)) ? v : u;
    default:
      return ValueOf(v) > ValueOf(u) || std::isnan(ValueOf(v)) ? v : u;
  }
}

}  // namespace unfurl::data
