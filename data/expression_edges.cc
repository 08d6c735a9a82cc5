// Where an expression changes its branch.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "data/expression.h"
#include "data/expression_ops.h"
#include "data/expression_parser.h"
#include "data/interval_series.h"

namespace unfurl::data {
namespace {

using ExpressionEdgesOp = Expression::Op;

// Parts of the duration on which an argument that is not linear is looked at, beside those that
// its bounds ask for. A few ms of work for each.
constexpr int kCells = 4096;
// Stretches that bounds are asked of; some 10 ms of work. Where that is not enough, two crossings
// within a stretch or part are not seen (docs/physics-simulator.md, "Edges").
constexpr std::size_t kMostStretches = 8192;
constexpr double kShortest = 1e-13;  // of the duration: stretches that are not halved any more
// Parts of the rise of a smoothstep. A method of fifth order integrates the quintic to 2.2e-3 of it
// in one step and to 7e-10 in twenty.
constexpr int kRiseParts = 20;

// Between `low` and `high`, where f has two signs: the last double before the change or the first
// after it, whichever f finds nearer to zero.
template <typename F>
double Crossing(const F& f, double low, double high) {
  const bool side = f(low) >= 0.0;
  while (std::nextafter(low, high) < high) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high)) break;
    ((f(middle) >= 0.0) == side ? low : high) = middle;
  }
  return std::fabs(f(low)) <= std::fabs(f(high)) ? low : high;
}

}  // namespace

double Expression::Decider(std::size_t place, double t) const {
  std::array<double, kExpressionDepth> stack;
  double* top = stack.data() - 1;
  for (std::size_t k = 0;; ++k) {
    const Instruction& i = program_[k];
    const int operands = OperandsOf(i.op);
    if (k == place) return operands == 2 ? top[-1] - top[0] : *top;
    if (operands == 0) {
      *++top = i.op == ExpressionEdgesOp::kTime ? t : i.number;
    } else if (operands == 1) {
      *top = ApplyUnary(i.op, *top);
    } else {
      --top;
      *top = ApplyBinary(i.op, top[0], top[1]);
    }
  }
}

std::vector<double> Expression::Isolate(std::size_t place, double level, double duration) const {
  std::vector<double> ends;
  std::vector<std::pair<double, double>> stretches = {{0.0, duration}};
  // Breadth first, so that what the bounds are not enough for is spread evenly.
  for (std::size_t k = 0; k < stretches.size() && k < kMostStretches; ++k) {
    const auto [a, b] = stretches[k];
    const IntervalSeries f = BoundOf(place, a, b, 1);
    if (!f.c[0].Holds(level)) continue;
    ends.push_back(a);
    ends.push_back(b);
    const bool monotone = f.c[1].low > 0.0 || f.c[1].high < 0.0;
    if (monotone || b - a < kShortest * duration) continue;
    stretches.emplace_back(a, 0.5 * (a + b));
    stretches.emplace_back(0.5 * (a + b), b);
  }
  return ends;
}

void Expression::AddCrossings(std::size_t place, double level, double duration,
                              std::vector<double>* edges) const {
  const auto f = [&](double t) { return Decider(place, t) - level; };
  // Linear in t: one crossing, where the straight line says, to the double. What looks so may have
  // a pulse between the looks: its second derivative says.
  const double f0 = f(0.0), f1 = f(duration);
  bool linear = std::isfinite(f0) && std::isfinite(f1) &&
                BoundOf(place, 0.0, duration, 2).c[2].Magnitude() == 0.0;
  for (const double part : {0.12, 0.31, 0.5, 0.77, 0.93}) {
    const double straight = f0 + part * (f1 - f0);
    const double rounding = 1e-13 * (std::fabs(f0) + std::fabs(f1));
    linear = linear && std::fabs(f(part * duration) - straight) <= rounding;
  }
  if (linear) {
    if ((f0 >= 0.0) != (f1 >= 0.0)) edges->push_back(Crossing(f, 0.0, duration));
    return;
  }
  std::vector<double> looks;
  for (int k = 0; k <= kCells; ++k) looks.push_back(duration * k / kCells);
  const std::vector<double> ends = Isolate(place, level, duration);
  looks.insert(looks.end(), ends.begin(), ends.end());
  for (const double at : *edges) {
    for (const double t : {std::nextafter(at, 0.0), at, std::nextafter(at, duration)}) {
      looks.push_back(t);
    }
  }
  std::sort(looks.begin(), looks.end());
  double before = f(looks.front());
  for (std::size_t k = 1; k < looks.size(); ++k) {
    const double after = f(looks[k]);
    if (std::isfinite(before) && std::isfinite(after) && (before >= 0.0) != (after >= 0.0)) {
      edges->push_back(Crossing(f, looks[k - 1], looks[k]));
    }
    before = after;
  }
}

std::vector<double> Expression::Edges(double duration) const {
  std::vector<double> edges;
  edges.reserve(2 * kRiseParts);
  for (std::size_t place = 0; place < program_.size(); ++place) {
    switch (program_[place].op) {
      case ExpressionEdgesOp::kSmoothStep:
        for (int k = 0; k <= kRiseParts; ++k) {
          AddCrossings(place, static_cast<double>(k) / kRiseParts, duration, &edges);
        }
        break;
      case ExpressionEdgesOp::kStep:
      case ExpressionEdgesOp::kRamp:
      case ExpressionEdgesOp::kAbs:
      case ExpressionEdgesOp::kMin:
      case ExpressionEdgesOp::kMax:
        AddCrossings(place, 0.0, duration, &edges);
        break;
      default:
        break;
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::erase_if(edges, [&](double t) { return !(t > 0.0 && t < duration); });
  return edges;
}

}  // namespace unfurl::data
