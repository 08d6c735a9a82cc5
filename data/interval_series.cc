#include "data/interval_series.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "data/expression_ops.h"

namespace unfurl::data {
namespace {

using SeriesOp = Expression::Op;
using Bounds = IntervalSeries;

constexpr double kWholePowers = 1e6;  // up to which they are made by multiplication

Bounds Unknown(const Interval& value) {
  Bounds out;
  out.c.fill(kEverything);
  out.c[0] = value;
  return out;
}

// value, first derivative, and what kinks may leave of the others.
Bounds Kinked(const Interval& value, const Interval& slope) {
  Bounds out = Unknown(value);
  out.c[1] = slope;
  return out;
}

Bounds Number(double x) {
  Bounds out;
  out.c[0] = {x, x};
  return out;
}

Bounds Negative(const Bounds& u, int order) {
  Bounds out;
  for (int k = 0; k <= order; ++k) out.c[k] = -u.c[k];
  return out;
}

Bounds Sum(const Bounds& u, const Bounds& v, double sign, int order) {
  Bounds out;
  for (int k = 0; k <= order; ++k) out.c[k] = u.c[k] + sign * v.c[k];
  return out;
}

Bounds Product(const Bounds& u, const Bounds& v, int order) {
  Bounds out;
  for (int k = 0; k <= order; ++k) {
    Interval sum;
    for (int j = 0; j <= k; ++j) sum = sum + u.c[j] * v.c[k - j];
    out.c[k] = sum;
  }
  return out;
}

Bounds Quotient(const Bounds& u, const Bounds& v, int order) {
  Bounds out;
  if (MayBeZero(v.c[0])) {  // asked out here: compilers divide before the loop
    std::fill_n(out.c.begin(), order + 1, kEverything);
    return out;
  }
  for (int k = 0; k <= order; ++k) {
    Interval rest = u.c[k];
    for (int j = 1; j <= k; ++j) rest = rest - v.c[j] * out.c[k - j];
    out.c[k] = rest / v.c[0];
  }
  return out;
}

// Of a function whose derivative is u' p, with p's coefficients known when they are asked for.
template <typename Factor>
Bounds Integrated(const Bounds& u, const Interval& value, int order, const Factor& factor) {
  Bounds out;
  out.c[0] = value;
  for (int k = 1; k <= order; ++k) {
    Interval sum;
    for (int j = 1; j <= k; ++j) sum = sum + static_cast<double>(j) * (u.c[j] * factor(k - j));
    out.c[k] = (1.0 / k) * sum;
  }
  return out;
}

Bounds Exponential(const Bounds& u, int order) {
  Bounds out;
  out.c[0] = Exp(u.c[0]);
  for (int k = 1; k <= order; ++k) {
    Interval sum;
    for (int j = 1; j <= k; ++j) sum = sum + static_cast<double>(j) * (u.c[j] * out.c[k - j]);
    out.c[k] = (1.0 / k) * sum;
  }
  return out;
}

Bounds Logarithm(const Bounds& u, int order) {
  constexpr double kLeast = 1e-300;  // whose logarithm is -690
  const Interval inside = {std::max(u.c[0].low, kLeast), std::max(u.c[0].high, kLeast)};
  const Interval value = {u.c[0].low > 0.0 ? std::log(inside.low) : -kUnbounded,
                          std::log(inside.high)};
  const Bounds part = Quotient(Number(1.0), u, order);
  return Integrated(u, value, order, [&](int k) { return part.c[k]; });
}

struct Waves {
  Bounds sine, cosine;
};

// s' = u' c and c' = sign u' s: sign -1 for circular functions, 1 for hyperbolic ones.
Waves WavesOf(const Bounds& u, const Interval& s0, const Interval& c0, double sign, int order) {
  Waves w;
  w.sine.c[0] = s0;
  w.cosine.c[0] = c0;
  for (int k = 1; k <= order; ++k) {
    Interval s, c;
    for (int j = 1; j <= k; ++j) {
      s = s + static_cast<double>(j) * (u.c[j] * w.cosine.c[k - j]);
      c = c + static_cast<double>(j) * (u.c[j] * w.sine.c[k - j]);
    }
    w.sine.c[k] = (1.0 / k) * s;
    w.cosine.c[k] = (sign / k) * c;
  }
  return w;
}

Waves Circular(const Bounds& u, int order) {
  const Interval quarter = {0.5 * std::numbers::pi, 0.5 * std::numbers::pi};
  return WavesOf(u, Sin(u.c[0]), Sin(u.c[0] + quarter), -1.0, order);
}

Waves Hyperbolic(const Bounds& u, int order) {
  const Interval up = Exp(u.c[0]), down = Exp(-u.c[0]);
  const Interval s = {0.5 * (up.low - down.high), 0.5 * (up.high - down.low)};
  Interval c = {0.5 * (up.low + down.high), 0.5 * (up.high + down.low)};  // at both ends
  c = {u.c[0].Holds(0.0) ? 1.0 : std::min(c.low, c.high), std::max(c.low, c.high)};
  return WavesOf(u, s, c, 1.0, order);
}

Bounds TangentHyperbolic(const Bounds& u, int order) {
  Bounds out, rest;  // rest = 1 - out^2
  out.c[0] = {std::tanh(u.c[0].low), std::tanh(u.c[0].high)};
  for (int k = 0; k <= order; ++k) {
    Interval sum;
    if (k > 0) {
      for (int j = 1; j <= k; ++j) sum = sum + static_cast<double>(j) * (u.c[j] * rest.c[k - j]);
      out.c[k] = (1.0 / k) * sum;
    }
    Interval square;
    for (int j = 0; j <= k; ++j) square = square + out.c[j] * out.c[k - j];
    rest.c[k] = k == 0 ? Interval{1.0, 1.0} - square : -square;
  }
  return out;
}

Bounds SquareRoot(const Bounds& u, int order) {
  Bounds out;
  out.c[0] = {std::sqrt(std::max(u.c[0].low, 0.0)), std::sqrt(std::max(u.c[0].high, 0.0))};
  for (int k = 1; k <= order; ++k) {
    Interval rest = u.c[k];
    for (int j = 1; j < k; ++j) rest = rest - out.c[j] * out.c[k - j];
    out.c[k] = rest / (2.0 * out.c[0]);
  }
  return out;
}

// asin, acos and atan: their derivative is a function of u.
Bounds Inverse(SeriesOp op, const Bounds& u, int order) {
  const Bounds square = Product(u, u, order), one = Number(1.0);
  if (op == SeriesOp::kAtan) {
    const Bounds factor = Quotient(one, Sum(one, square, 1.0, order), order);
    return Integrated(u, {std::atan(u.c[0].low), std::atan(u.c[0].high)}, order,
                      [&](int k) { return factor.c[k]; });
  }
  const Bounds root = SquareRoot(Sum(one, square, -1.0, order), order);
  const Bounds factor = Quotient(one, root, order);
  const auto inside = [](double x) { return std::clamp(x, -1.0, 1.0); };
  const Interval sine = {std::asin(inside(u.c[0].low)), std::asin(inside(u.c[0].high))};
  const Bounds out = Integrated(u, sine, order, [&](int k) { return factor.c[k]; });
  if (op == SeriesOp::kAsin) return out;
  return Sum(Number(0.5 * std::numbers::pi), out, -1.0, order);
}

double BoundedPower(double x, double n) {
  constexpr double kMost = 345.0;  // the logarithm of kUnbounded
  if (x == 0.0) return n == 0.0 ? 1.0 : 0.0;
  return n * std::log(x) > kMost ? kUnbounded : std::pow(x, n);
}

Bounds WholePower(const Bounds& u, double n, int order) {
  Bounds out = Number(1.0), base = u;
  for (auto left = static_cast<long>(n); left > 0; left /= 2) {
    if (left % 2 == 1) out = Product(out, base, order);
    if (left > 1) base = Product(base, base, order);
  }
  const bool even = std::fmod(n, 2.0) == 0.0;
  const auto at = [&](double x) {
    const double size = BoundedPower(std::fabs(x), n);
    return x < 0.0 && !even ? -size : size;
  };
  const double a = at(u.c[0].low), b = at(u.c[0].high);
  out.c[0] = {even && u.c[0].Holds(0.0) && n > 0.0 ? 0.0 : std::min(a, b), std::max(a, b)};
  return out;
}

bool IsConstant(const Bounds& v, int order) {
  for (int k = 1; k <= order; ++k) {
    if (v.c[k].low != 0.0 || v.c[k].high != 0.0) return false;
  }
  return v.c[0].IsNumber();
}

Bounds RaisedTo(const Bounds& u, const Bounds& v, int order) {
  const double n = v.c[0].low;
  if (IsConstant(v, order) && n == std::round(n) && std::fabs(n) <= kWholePowers) {
    const Bounds power = WholePower(u, std::fabs(n), order);
    return n < 0.0 ? Quotient(Number(1.0), power, order) : power;
  }
  return Exponential(Product(v, Logarithm(u, order), order), order);
}

Bounds SmoothRise(const Bounds& u, int order) {
  const Interval value = {SmoothStep(u.c[0].low), SmoothStep(u.c[0].high)};
  if (u.c[0].high <= 0.0 || u.c[0].low >= 1.0) {
    Bounds flat;
    flat.c[0] = value;
    return flat;
  }
  const bool leaves = u.c[0].low < 0.0 || u.c[0].high > 1.0;
  Bounds x = u;
  x.c[0] = {std::max(x.c[0].low, 0.0), std::min(x.c[0].high, 1.0)};
  const Bounds square = Product(x, x, order), cube = Product(square, x, order);
  Bounds factor = Sum(Product(Number(6.0), x, order), Number(15.0), -1.0, order);
  factor = Sum(Number(10.0), Product(x, factor, order), 1.0, order);
  Bounds out = Product(cube, factor, order);
  for (int k = 1; leaves && k <= order; ++k) {
    out.c[k] = k <= 2 ? Hull(out.c[k], Interval{}) : kEverything;  // the third derivative jumps
  }
  out.c[0] = value;
  return out;
}

Bounds OfBranches(SeriesOp op, const Bounds& u, int order) {
  const Interval& x = u.c[0];
  if (op == SeriesOp::kSmoothStep) return SmoothRise(u, order);
  if (op == SeriesOp::kStep) {
    return x.low >= 0.0 ? Number(1.0) : x.high < 0.0 ? Number(0.0) : Unknown({0.0, 1.0});
  }
  if (x.low >= 0.0) return u;
  if (op == SeriesOp::kAbs) {
    if (x.high <= 0.0) return Negative(u, order);
    return Kinked({0.0, x.Magnitude()}, Hull(u.c[1], -u.c[1]));
  }
  if (x.high < 0.0) return Number(0.0);
  return Kinked({0.0, x.high}, Hull(u.c[1], Interval{}));
}

Bounds Smaller(const Bounds& u, const Bounds& v) {
  if (u.c[0].high <= v.c[0].low) return u;
  if (v.c[0].high <= u.c[0].low) return v;
  return Kinked({std::min(u.c[0].low, v.c[0].low), std::min(u.c[0].high, v.c[0].high)},
                Hull(u.c[1], v.c[1]));
}

}  // namespace

IntervalSeries ApplyUnary(Expression::Op op, const IntervalSeries& u, int order) {
  switch (op) {
    case SeriesOp::kNegate:
      return Negative(u, order);
    case SeriesOp::kSin:
      return Circular(u, order).sine;
    case SeriesOp::kCos:
      return Circular(u, order).cosine;
    case SeriesOp::kTan: {
      const Waves w = Circular(u, order);
      return Quotient(w.sine, w.cosine, order);
    }
    case SeriesOp::kAsin:
    case SeriesOp::kAcos:
    case SeriesOp::kAtan:
      return Inverse(op, u, order);
    case SeriesOp::kSinh:
      return Hyperbolic(u, order).sine;
    case SeriesOp::kCosh:
      return Hyperbolic(u, order).cosine;
    case SeriesOp::kTanh:
      return TangentHyperbolic(u, order);
    case SeriesOp::kExp:
      return Exponential(u, order);
    case SeriesOp::kLog:
      return Logarithm(u, order);
    case SeriesOp::kSqrt:
      return SquareRoot(u, order);
    default:
      return OfBranches(op, u, order);
  }
}

IntervalSeries ApplyBinary(Expression::Op op, const IntervalSeries& u, const IntervalSeries& v,
                           int order) {
  switch (op) {
    case SeriesOp::kAdd:
      return Sum(u, v, 1.0, order);
    case SeriesOp::kSubtract:
      return Sum(u, v, -1.0, order);
    case SeriesOp::kMultiply:
      return Product(u, v, order);
    case SeriesOp::kDivide:
      return Quotient(u, v, order);
    case SeriesOp::kPower:
      return RaisedTo(u, v, order);
    case SeriesOp::kMin:
      return Smaller(u, v);
    default:
      return Negative(Smaller(Negative(u, order), Negative(v, order)), order);
  }
}

}  // namespace unfurl::data
