#include "data/time_function.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "data/interval_series.h"
#include "data/time_function_impl.h"

namespace unfurl::data {
namespace {

using TimeFunctionImpl = TimeFunction::Impl;

struct Constant : TimeFunctionImpl {
  double value;
  explicit Constant(double v) : value(v) {}
  TimeValue At(double) const override { return {value, 0.0, 0.0}; }
  double Value(double) const override { return value; }
  bool is_constant() const override { return true; }
  std::shared_ptr<const TimeFunctionImpl> Integral(double start, double) const override;
  std::string text() const override { return fmt::format("{}", value); }
};

struct TimeFunctionLine : TimeFunctionImpl {
  double start, slope;
  TimeFunctionLine(double s, double r) : start(s), slope(r) {}
  TimeValue At(double t) const override { return {start + slope * t, slope, 0.0}; }
  std::shared_ptr<const TimeFunctionImpl> Integral(double, double) const override {
    throw Error("an integral of an integral", where, "give the function itself");
  }
  std::string text() const override { return fmt::format("{} + {} * t", start, slope); }
};

std::shared_ptr<const TimeFunctionImpl> Constant::Integral(double start, double) const {
  auto line = std::make_shared<TimeFunctionLine>(start, value);
  line->where = where;
  return line;
}

struct Formula : TimeFunctionImpl, std::enable_shared_from_this<Formula> {
  Expression expression;
  explicit Formula(Expression e) : expression(std::move(e)) {}
  TimeValue At(double t) const override { return expression.At(t); }
  double Value(double t) const override { return expression.Value(t); }
  bool is_constant() const override { return expression.is_constant(); }
  std::shared_ptr<const TimeFunctionImpl> Integral(double start, double duration) const override {
    return IntegrateSmooth(shared_from_this(), start, duration);
  }
  std::optional<Expression::Fault> FindFault(double duration, int derivatives,
                                             int cells) const override {
    return expression.FindFault(duration, derivatives, cells);
  }
  std::vector<double> Edges(double duration) const override { return expression.Edges(duration); }
  std::optional<TimeFunction::Bounds> Bound(double a, double b, int derivative) const override {
    // From Taylor's coefficients: k! of them.
    constexpr double kFactorial[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0};
    const IntervalSeries series = expression.Bound(a, b, derivative + 4);
    const Interval& value = series.c[derivative];
    const double factor = kFactorial[derivative];
    return TimeFunction::Bounds{factor * value.low, factor * value.high,
                                kFactorial[derivative + 4] * series.c[derivative + 4].Magnitude()};
  }
  std::string text() const override { return expression.text(); }
};

// Cubics between the points, by powers of the time since the piece's start.
struct Pieces {
  std::vector<double> t;                 // n points [s]
  std::vector<std::array<double, 4>> c;  // n - 1 pieces
  std::vector<double> sum;               // integral from t[0] to t[k], n

  // The piece at t, which lies within the points.
  std::size_t Find(double at) const {
    const auto above = std::upper_bound(t.begin() + 1, t.end() - 1, at);
    return static_cast<std::size_t>(above - t.begin()) - 1;
  }
  std::vector<double> Edges(double duration) const {
    std::vector<double> inside;
    inside.reserve(t.size());
    for (const double at : t) {
      if (at > 0.0 && at < duration) inside.push_back(at);
    }
    return inside;
  }
  double First() const { return c.front()[0]; }
  double Last() const { return last; }
  TimeValue At(double at) const {
    if (at < t.front()) return {First(), 0.0, 0.0};
    if (at >= t.back()) return {Last(), 0.0, 0.0};
    const std::size_t k = Find(at);
    const auto& a = c[k];
    const double s = at - t[k];
    return {a[0] + s * (a[1] + s * (a[2] + s * a[3])), a[1] + s * (2.0 * a[2] + s * 3.0 * a[3]),
            2.0 * a[2] + 6.0 * s * a[3]};
  }
  double Sum(double at) const {
    if (at <= t.front()) return First() * (at - t.front());
    if (at >= t.back()) return sum.back() + Last() * (at - t.back());
    const std::size_t k = Find(at);
    const auto& a = c[k];
    const double s = at - t[k];
    return sum[k] + s * (a[0] + s * (a[1] / 2.0 + s * (a[2] / 3.0 + s * a[3] / 4.0)));
  }
  double last = 0.0;
};

struct PointsIntegral : TimeFunctionImpl {
  std::shared_ptr<const Pieces> pieces;
  double offset;
  PointsIntegral(std::shared_ptr<const Pieces> p, double start)
      : pieces(std::move(p)), offset(start - pieces->Sum(0.0)) {}
  TimeValue At(double t) const override {
    const TimeValue rate = pieces->At(t);
    return {offset + pieces->Sum(t), rate.value, rate.rate};
  }
  std::shared_ptr<const TimeFunctionImpl> Integral(double, double) const override {
    throw Error("an integral of an integral", where, "give the function itself");
  }
  std::vector<double> Edges(double duration) const override { return pieces->Edges(duration); }
  std::string text() const override { return "the integral of a table"; }
};

struct Points : TimeFunctionImpl {
  std::shared_ptr<const Pieces> pieces;
  TimeValue At(double t) const override { return pieces->At(t); }
  std::shared_ptr<const TimeFunctionImpl> Integral(double start, double) const override {
    auto integral = std::make_shared<PointsIntegral>(pieces, start);
    integral->where = where;
    return integral;
  }
  std::vector<double> Edges(double duration) const override { return pieces->Edges(duration); }
  std::string text() const override { return "a table"; }
};

// Second derivatives of the natural spline at the points, by the tridiagonal system.
std::vector<double> NaturalCurvature(const std::vector<double>& t, const std::vector<double>& y) {
  const std::size_t n = t.size();
  std::vector<double> m(n, 0.0), pivot(n, 1.0);
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double left = t[k] - t[k - 1], right = t[k + 1] - t[k];
    const double below = k > 1 ? left / pivot[k - 1] : 0.0;
    pivot[k] = 2.0 * (left + right) - below * (k > 1 ? left : 0.0);
    m[k] = 6.0 * ((y[k + 1] - y[k]) / right - (y[k] - y[k - 1]) / left) - below * m[k - 1];
  }
  for (std::size_t k = n - 1; k-- > 1;) {
    const double right = t[k + 1] - t[k];
    m[k] = (m[k] - (k + 2 < n ? right * m[k + 1] : 0.0)) / pivot[k];
  }
  return m;
}

}  // namespace

TimeFunction::TimeFunction(double constant) : impl_(std::make_shared<Constant>(constant)) {}

TimeFunction TimeFunction::Expression(const std::string& text, const std::string& where) {
  auto formula = std::make_shared<Formula>(data::Expression(text, where));
  formula->where = where;
  return TimeFunction(std::move(formula));
}

TimeFunction TimeFunction::Table(std::vector<double> t, std::vector<double> value, bool cubic,
                                 const std::string& where) {
  if (t.size() < 2) throw Error("the table has less than two points", where, "give two or more");
  if (t.size() != value.size()) {
    throw Error(fmt::format("the table has {} times and {} values", t.size(), value.size()), where,
                "give as many of each");
  }
  for (std::size_t k = 0; k < t.size(); ++k) {
    if (!std::isfinite(t[k]) || !std::isfinite(value[k])) {
      throw Error(fmt::format("point {} of the table is not finite", k + 1), where, "correct it");
    }
    if (k > 0 && !(t[k] > t[k - 1])) {
      throw Error(fmt::format("the table's times do not rise: {} follows {}", t[k], t[k - 1]),
                  where, "put them in order, each once");
    }
  }
  const std::vector<double> m =
      cubic ? NaturalCurvature(t, value) : std::vector<double>(t.size(), 0.0);
  auto pieces = std::make_shared<Pieces>();
  pieces->sum.push_back(0.0);
  for (std::size_t k = 0; k + 1 < t.size(); ++k) {
    const double h = t[k + 1] - t[k];
    pieces->c.push_back({value[k],
                         (value[k + 1] - value[k]) / h - h * (2.0 * m[k] + m[k + 1]) / 6.0,
                         m[k] / 2.0, (m[k + 1] - m[k]) / (6.0 * h)});
    const auto& c = pieces->c.back();
    pieces->sum.push_back(pieces->sum.back() +
                          h * (c[0] + h * (c[1] / 2.0 + h * (c[2] / 3.0 + h * c[3] / 4.0))));
  }
  pieces->last = value.back();
  pieces->t = std::move(t);
  auto points = std::make_shared<Points>();
  points->pieces = std::move(pieces);
  points->where = where;
  return TimeFunction(std::move(points));
}

TimeValue TimeFunction::At(double t) const { return impl_->At(t); }
double TimeFunction::Value(double t) const { return impl_->Value(t); }
bool TimeFunction::is_constant() const { return impl_->is_constant(); }

TimeFunction TimeFunction::Integral(double start, double duration) const {
  return TimeFunction(impl_->Integral(start, duration));
}

void TimeFunction::CheckFinite(double duration, int derivatives, int cells) const {
  const auto fault = impl_->FindFault(duration, derivatives, cells);
  if (!fault) return;
  throw Error(fmt::format("\"{}\" {} at t = {:.9g} s", impl_->text(), fault->reason, fault->t),
              impl_->where, "change it, or end the run before");
}

bool TimeFunction::IsFinite(double t, int derivatives) const {
  const TimeValue v = impl_->At(t);
  return std::isfinite(v.value) && (derivatives < 1 || std::isfinite(v.rate)) &&
         (derivatives < 2 || std::isfinite(v.acceleration));
}

std::vector<double> TimeFunction::Edges(double duration) const { return impl_->Edges(duration); }

std::optional<TimeFunction::Bounds> TimeFunction::Bound(double a, double b, int derivative) const {
  return impl_->Bound(a, b, derivative);
}

std::optional<double> TimeFunction::FindJump(double duration) const {
  // Rounding of the function's own terms, and of the time where it is steep.
  constexpr double kRounding = 1e-9, kUlps = 16.0 * std::numeric_limits<double>::epsilon();
  constexpr int kLooks = 64;
  const std::vector<double> edges = Edges(duration);
  double size = 0.0;
  for (int k = 0; k <= kLooks; ++k) size = std::max(size, std::fabs(Value(duration * k / kLooks)));
  for (const double at : edges) size = std::max(size, std::fabs(Value(at)));
  for (const double at : edges) {
    // Neighbours within some roundings are one edge.
    const TimeValue before = At(at - kUlps * at), after = At(at + kUlps * at);
    const double steep = std::fabs(before.rate) + std::fabs(after.rate);
    if (std::fabs(after.value - before.value) > kRounding * size + 2.0 * kUlps * at * steep) {
      return at;
    }
  }
  return std::nullopt;
}

std::string TimeFunction::Describe() const {
  return impl_->where.empty() ? fmt::format("\"{}\"", impl_->text())
                              : fmt::format("\"{}\" ({})", impl_->text(), impl_->where);
}

}  // namespace unfurl::data
