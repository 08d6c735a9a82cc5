#include "data/expression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "data/expression_ops.h"
#include "data/expression_parser.h"

namespace unfurl::data {
namespace {

using ExpressionOp = Expression::Op;

double Unary(ExpressionOp op, double x) { return ApplyUnary(op, x); }

// Functions of several branches, f their value: derivatives on the branch that u is on.
TimeValue Piecewise(ExpressionOp op, const TimeValue& u, double f) {
  const double x = u.value;
  switch (op) {
    case ExpressionOp::kAbs:
      return Chain(u, f, x < 0.0 ? -1.0 : 1.0, 0.0);
    case ExpressionOp::kStep:
      return {f, 0.0, 0.0};
    case ExpressionOp::kRamp:
      return x < 0.0 ? TimeValue{} : u;
    default: {  // the smooth step
      if (x <= 0.0 || x >= 1.0) return {f, 0.0, 0.0};
      const double r = x * (1.0 - x);
      return Chain(u, f, 30.0 * r * r, 60.0 * r * (1.0 - 2.0 * x));
    }
  }
}

// The chain rule with the first and second derivative of each function.
TimeValue Unary(ExpressionOp op, const TimeValue& u) {
  const double x = u.value, f = Unary(op, x);
  switch (op) {
    case ExpressionOp::kNegate:
      return -u;
    case ExpressionOp::kSin:
      return Chain(u, f, std::cos(x), -f);
    case ExpressionOp::kCos:
      return Chain(u, f, -std::sin(x), -f);
    case ExpressionOp::kTan:
      return Chain(u, f, 1.0 + f * f, 2.0 * f * (1.0 + f * f));
    case ExpressionOp::kAsin: {
      const double d = 1.0 / std::sqrt(1.0 - x * x);
      return Chain(u, f, d, x * d * d * d);
    }
    case ExpressionOp::kAcos: {
      const double d = -1.0 / std::sqrt(1.0 - x * x);
      return Chain(u, f, d, x * d * d * d);
    }
    case ExpressionOp::kAtan: {
      const double d = 1.0 / (1.0 + x * x);
      return Chain(u, f, d, -2.0 * x * d * d);
    }
    case ExpressionOp::kSinh:
      return Chain(u, f, std::cosh(x), f);
    case ExpressionOp::kCosh:
      return Chain(u, f, std::sinh(x), f);
    case ExpressionOp::kTanh:
      return Chain(u, f, 1.0 - f * f, -2.0 * f * (1.0 - f * f));
    case ExpressionOp::kExp:
      return Chain(u, f, f, f);
    case ExpressionOp::kLog:
      return Chain(u, f, 1.0 / x, -1.0 / (x * x));
    case ExpressionOp::kSqrt:
      return Chain(u, f, 0.5 / f, -0.25 / (f * x));
    default:
      return Piecewise(op, u, f);
  }
}

bool Finite(const TimeValue& v, int derivatives) {
  return std::isfinite(v.value) && (derivatives < 1 || std::isfinite(v.rate)) &&
         (derivatives < 2 || std::isfinite(v.acceleration));
}

// What must not pass through zero: a divisor, the cosine in a tangent, a base with a negative
// exponent.
bool Divides(ExpressionOp op) {
  return op == ExpressionOp::kDivide || op == ExpressionOp::kTan || op == ExpressionOp::kPower;
}

}  // namespace

TimeValue Power(const TimeValue& u, const TimeValue& v) {
  const double c = v.value, f = std::pow(u.value, c);
  if (v.rate == 0.0 && v.acceleration == 0.0) {
    // Whole exponents are differentiable at zero, where the factors alone would say 0 * infinity.
    const double f1 = c == 0.0 ? 0.0 : c * std::pow(u.value, c - 1.0);
    const double f2 = c == 0.0 || c == 1.0 ? 0.0 : c * (c - 1.0) * std::pow(u.value, c - 2.0);
    return Chain(u, f, f1, f2);
  }
  const TimeValue exponent = v * Unary(ExpressionOp::kLog, u);
  return Chain(exponent, f, f, f);
}

Expression::Expression(const std::string& text, const std::string& where)
    : Expression(ParseExpression(text, where)) {
  text_ = text;
}

Expression::Expression(std::vector<Instruction> program) : program_(std::move(program)) {
  for (const Instruction& i : program_) divisions_ += Divides(i.op);
}

bool Expression::is_constant() const {
  return std::none_of(program_.begin(), program_.end(),
                      [](const Instruction& i) { return i.op == ExpressionOp::kTime; });
}

template <typename T>
T Expression::Run(double t) const {
  std::array<T, kExpressionDepth> stack;
  T* top = stack.data() - 1;
  for (const Instruction& i : program_) {
    switch (OperandsOf(i.op)) {
      case 0:
        if constexpr (std::is_same_v<T, double>) {
          *++top = i.op == ExpressionOp::kTime ? t : i.number;
        } else {
          *++top = i.op == ExpressionOp::kTime ? T{t, 1.0, 0.0} : T{i.number, 0.0, 0.0};
        }
        break;
      case 1:
        *top = Unary(i.op, *top);
        break;
      default:
        --top;
        *top = ApplyBinary(i.op, top[0], top[1]);
    }
  }
  return *top;
}

double Expression::Value(double t) const { return Run<double>(t); }
TimeValue Expression::At(double t) const { return Run<TimeValue>(t); }

double Expression::Divisor(int k, double t) const {
  std::array<double, kExpressionDepth> stack;
  double* top = stack.data() - 1;
  for (const Instruction& i : program_) {
    const int operands = OperandsOf(i.op);
    if (Divides(i.op) && k-- == 0) {
      if (i.op == ExpressionOp::kDivide) return *top;
      if (i.op == ExpressionOp::kTan) return std::cos(*top);
      return *top < 0.0 ? top[-1] : 1.0;
    }
    if (operands == 0) {
      *++top = i.op == ExpressionOp::kTime ? t : i.number;
    } else if (operands == 1) {
      *top = Unary(i.op, *top);
    } else {
      --top;
      *top = ApplyBinary(i.op, top[0], top[1]);
    }
  }
  return 1.0;
}

namespace {

// Why an operation on u, or on u and v, has no finite value.
std::string WhyNotFinite(ExpressionOp op, double u, double v) {
  switch (op) {
    case ExpressionOp::kDivide:
      return v == 0.0 ? "divides by zero" : "grows beyond all numbers";
    case ExpressionOp::kLog:
      return "takes the logarithm of a number that is not positive";
    case ExpressionOp::kSqrt:
      return "takes the square root of a negative number";
    case ExpressionOp::kAsin:
    case ExpressionOp::kAcos:
      return "takes the inverse sine or cosine of a number beyond 1";
    case ExpressionOp::kPower:
      if (u == 0.0) return "divides by zero";
      return u < 0.0 ? "takes a broken power of a negative number" : "grows beyond all numbers";
    default:
      return "grows beyond all numbers";
  }
}

}  // namespace

std::string Expression::Reason(double t) const {
  std::array<double, kExpressionDepth> stack;
  double* top = stack.data() - 1;
  for (const Instruction& i : program_) {
    const int operands = OperandsOf(i.op);
    if (operands == 0) {
      *++top = i.op == ExpressionOp::kTime ? t : i.number;
      continue;
    }
    if (operands == 2) --top;
    const double u = top[0], v = operands == 2 ? top[1] : 0.0;
    *top = operands == 1 ? Unary(i.op, u) : ApplyBinary(i.op, u, v);
    if (std::isfinite(*top)) continue;
    return WhyNotFinite(i.op, u, v);
  }
  return "has no finite rate or acceleration";
}

namespace {

constexpr int kBisections = 200;  // to neighbouring numbers

// The last time before `wrong` that is still good, bisected to neighbouring numbers; returns the
// first that is not. `is_wrong(wrong)` holds and `is_wrong(good)` does not.
template <typename Predicate>
std::pair<double, double> Bisect(double good, double wrong, const Predicate& is_wrong) {
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (good + wrong);
    if (middle == good || middle == wrong) break;
    (is_wrong(middle) ? wrong : good) = middle;
  }
  return {good, wrong};
}

// Where |f| is least in [low, high], by golden section; f has one minimum there.
template <typename Function>
double LeastMagnitude(double low, double high, const Function& f) {
  for (int i = 0; i < kBisections && high - low > 1e-15 * high; ++i) {
    const double left = low + 0.382 * (high - low), right = low + 0.618 * (high - low);
    if (std::fabs(f(left)) < std::fabs(f(right))) {
      high = right;
    } else {
      low = left;
    }
  }
  return 0.5 * (low + high);
}

}  // namespace

std::optional<Expression::Fault> Expression::FindFault(double duration, int derivatives,
                                                       int cells) const {
  // A divisor that is this small beside its value one cell away is zero; a double zero is found to
  // the square root of rounding only.
  constexpr double kZero = 1e-7;
  const auto bad = [&](double t) {
    return derivatives == 0 ? !std::isfinite(Value(t)) : !Finite(At(t), derivatives);
  };
  if (is_constant()) {
    if (bad(0.0)) return Fault{0.0, Reason(0.0)};
    return std::nullopt;
  }
  const auto time = [&](int k) { return duration * k / cells; };
  std::vector<double> before(divisions_), here(divisions_), after(divisions_);
  for (int k = 0; k <= cells; ++k) {
    if (bad(time(k))) {
      const double wrong = k > 0 ? Bisect(time(k - 1), time(k), bad).second : time(0);
      return Fault{wrong, Reason(wrong)};
    }
    for (int d = 0; d < divisions_; ++d) {
      after[d] = Divisor(d, time(k));
      const auto divisor = [&](double t) { return Divisor(d, t); };
      const double largest =
          std::max({std::fabs(before[d]), std::fabs(here[d]), std::fabs(after[d])});
      const bool changes_sign = k > 0 && here[d] * after[d] < 0.0;
      const bool dips = k > 1 && std::fabs(here[d]) < std::fabs(before[d]) &&
                        std::fabs(here[d]) <= std::fabs(after[d]);
      if (changes_sign) {
        const auto [low, high] =
            Bisect(time(k - 1), time(k), [&](double t) { return !(divisor(t) * here[d] > 0.0); });
        const double least = std::max(std::fabs(divisor(low)), std::fabs(divisor(high)));
        if (least < kZero * largest) return Fault{high, "divides by zero"};
      } else if (dips) {
        const double t = LeastMagnitude(time(k - 2), time(k), divisor);
        if (std::fabs(divisor(t)) < kZero * largest && !NeverZero(d, time(k - 2), time(k))) {
          return Fault{t, "divides by zero"};
        }
      }
    }
    before.swap(here);
    here.swap(after);
  }
  return std::nullopt;
}

}  // namespace unfurl::data
