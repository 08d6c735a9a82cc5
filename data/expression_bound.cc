// Bounds of an expression over a stretch of time.
#include <array>

#include "data/expression.h"
#include "data/expression_ops.h"
#include "data/expression_parser.h"
#include "data/interval_series.h"

namespace unfurl::data {

IntervalSeries Expression::Bound(double a, double b, int order) const {
  return BoundOf(program_.size(), a, b, order);
}

IntervalSeries Expression::BoundOf(std::size_t place, double a, double b, int order) const {
  std::array<IntervalSeries, kExpressionDepth> stack;
  IntervalSeries* top = stack.data() - 1;
  for (std::size_t k = 0; k < program_.size(); ++k) {
    const Instruction& i = program_[k];
    const int operands = OperandsOf(i.op);
    if (k == place) {
      if (i.op == Op::kDivide || operands != 2) return *top;
      return ApplyBinary(Op::kSubtract, top[-1], top[0], order);
    }
    if (operands == 0) {
      *++top = {};
      const bool time = i.op == Op::kTime;
      top->c[0] = time ? Interval{a, b} : Interval{i.number, i.number};
      if (time) top->c[1] = {1.0, 1.0};
    } else if (operands == 1) {
      *top = ApplyUnary(i.op, *top, order);
    } else {
      --top;
      *top = ApplyBinary(i.op, top[0], top[1], order);
    }
  }
  return *top;
}

bool Expression::NeverZero(int k, double a, double b) const {
  for (std::size_t place = 0; place < program_.size(); ++place) {
    const Op op = program_[place].op;
    if (op != Op::kDivide && op != Op::kTan && op != Op::kPower) continue;
    if (k-- > 0) continue;
    return op == Op::kDivide && !BoundOf(place, a, b, 0).c[0].Holds(0.0);
  }
  return false;
}

}  // namespace unfurl::data
