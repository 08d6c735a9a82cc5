#pragma once

#include <array>

#include "data/expression.h"
#include "data/interval.h"

namespace unfurl::data {

// Taylor's coefficients of a function of time, bounded over a stretch of it: c[k] holds f^(k) / k!
// at each of its times [Moore 1966]. Private to expressions.
struct IntervalSeries {
  static constexpr int kMostOrder = 6;  // four more than a drive's acceleration needs
  std::array<Interval, kMostOrder + 1> c{};
};

// The operations of an expression's program; coefficients up to `order`.
IntervalSeries ApplyUnary(Expression::Op op, const IntervalSeries& u, int order);
IntervalSeries ApplyBinary(Expression::Op op, const IntervalSeries& u, const IntervalSeries& v,
                           int order);

}  // namespace unfurl::data
