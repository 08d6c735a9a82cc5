#include "sim/methods/function_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace unfurl::sim {
namespace {

// Parts of a step. A quartic goes through the first five, Chebyshev's, all within the step: at its
// ends an edge may be. The others lie where no period of the whole is a multiple of the step.
constexpr std::array<double, 5> kThrough = {0.02447174185242318, 0.20610737385376343, 0.5,
                                            0.7938926261462366, 0.9755282581475768};
constexpr std::array<double, 5> kBetween = {0.0901699437494742, 0.3389830508474576,
                                            0.4142135623730951, 0.6180339887498949,
                                            0.8660254037844386};
// Where steps miss nothing that a run's result shows: the tolerances that methods keep
// (docs/accuracy.md), and never more than a thousandth.
constexpr double kTolerances = 10.0, kMostPart = 1e-3;
// Samples over the run from which a function's range is known before it is seen. Not a power of
// two: periods often are.
constexpr int kLooks = 1021;
// Of a function's area, that may hide in a cell: impulses are right to about that.
constexpr double kHidden = 1e-6;
// Cells of a run, some 0.1 s of work; and what may hide in one where they are not enough, that is
// worth a word.
constexpr std::size_t kMostCells = 1 << 15;
constexpr double kWorthAWord = 1e-3;
// Of a cell, that a step may be long: ten places are looked at in a step (kThrough, kBetween), and
// a cubic, as cells are judged by, has four.
constexpr double kCells = 2.5;
// Of the run's duration: with steps that short a run would not end. A kink has some of them.
constexpr double kHopelessStep = 1e-9;
constexpr long kHopelessSteps = 1000;

// Lagrange's weights of the points passed through, for each one between.
constexpr auto kWeights = [] {
  std::array<std::array<double, kThrough.size()>, kBetween.size()> weights{};
  for (std::size_t b = 0; b < kBetween.size(); ++b) {
    for (std::size_t k = 0; k < kThrough.size(); ++k) {
      double w = 1.0;
      for (std::size_t j = 0; j < kThrough.size(); ++j) {
        if (j != k) w *= (kBetween[b] - kThrough[j]) / (kThrough[k] - kThrough[j]);
      }
      weights[b][k] = w;
    }
  }
  return weights;
}();

}  // namespace

double FunctionWatch::Watched::At(double t) const {
  if (of->derivatives == 0) return of->function.Value(t);
  const data::TimeValue v = of->function.At(t);
  return of->derivatives == 1 ? v.rate : v.acceleration;
}

void FunctionWatch::Watched::See(double value) {
  low = std::min(low, value);
  high = std::max(high, value);
}

// A value that is not finite is no matter of the step: the right side finds it.
bool FunctionWatch::Watched::Follows(double t, double h, double part) {
  std::array<double, kThrough.size()> through{};
  double least = HUGE_VAL, most = -HUGE_VAL;
  for (std::size_t k = 0; k < through.size(); ++k) {
    through[k] = At(t + kThrough[k] * h);
    if (!std::isfinite(through[k])) return true;
    least = std::min(least, through[k]);
    most = std::max(most, through[k]);
  }
  double off = 0.0;
  for (std::size_t b = 0; b < kBetween.size(); ++b) {
    const double value = At(t + kBetween[b] * h);
    if (!std::isfinite(value)) return true;
    double polynomial = 0.0;
    for (std::size_t k = 0; k < through.size(); ++k) polynomial += kWeights[b][k] * through[k];
    off = std::max(off, std::fabs(value - polynomial));
    least = std::min(least, value);
    most = std::max(most, value);
  }
  See(least);
  See(most);
  // Of a time t a double holds so much; and sums of so large terms are rounded.
  constexpr double kEpsilon = 8.0 * std::numeric_limits<double>::epsilon();
  const double rounding =
      kEpsilon * ((most - least) * t / h + std::max(std::fabs(least), std::fabs(most)));
  return off <= part * (high - low) + rounding;
}

double FunctionWatch::Watched::Allowed(double t, double h) {
  while (at < cells.size() && cells[at].end <= t) ++at;
  for (std::size_t k = at; k < cells.size() && cells[k].begin < t + h; ++k) {
    h = std::min(h, std::max(kCells * (cells[k].end - cells[k].begin), cells[k].begin - t));
  }
  return h;
}

FunctionWatch::FunctionWatch(const Model& model, double duration, double rtol, double longest)
    : hopeless_(kHopelessStep * duration), part_(std::min(kMostPart, kTolerances * rtol)) {
  for (const Model::Function& f : model.functions) {
    if (f.function.is_constant()) continue;
    Watched w{&f, HUGE_VAL, -HUGE_VAL, 0.0, {}};
    data::FunctionScan scan = f.function.Scan(f.derivatives, duration, kHidden, kMostCells);
    if (!scan.cells.empty()) {
      w.See(scan.low);
      w.See(scan.high);
      w.hidden_part = scan.area > 0.0 ? scan.hidden / scan.area : 0.0;
      std::erase_if(scan.cells,
                    [&](const auto& cell) { return kCells * (cell.end - cell.begin) >= longest; });
      w.cells = std::move(scan.cells);
    }
    for (int k = 0; k < kLooks; ++k) {
      const double value = w.At(duration * (k + 0.5) / kLooks);
      if (std::isfinite(value)) w.See(value);
    }
    watched_.push_back(w);
  }
}

double FunctionWatch::Resolved(double t, double h) {
  const double wished = h;
  // Below this, times within the step are equal but for rounding.
  const double least = 64.0 * std::numeric_limits<double>::epsilon() * t;
  for (Watched& w : watched_) {
    h = w.Allowed(t, h);
    while (h > least && !w.Follows(t, h, part_)) {
      h *= 0.5;
      last_ = &w;
    }
  }
  hopeless_steps_ = h < wished && h < hopeless_ ? hopeless_steps_ + 1 : 0;
  return h;
}

std::vector<std::string> FunctionWatch::Warnings() const {
  std::vector<std::string> out;
  for (const Watched& w : watched_) {
    if (w.hidden_part <= kWorthAWord) continue;
    out.push_back(fmt::format(
        "{} could not be looked through: a short pulse in it may be missed, of {:.1g} of its whole "
        "integral at most; give it as a table, or simulate a shorter time",
        w.of->function.Describe(), std::min(w.hidden_part, 1.0)));
  }
  return out;
}

std::string FunctionWatch::Complaint() const {
  if (hopeless_steps_ < kHopelessSteps) return {};
  return fmt::format(
      "{} swings so fast that the run would take more than 1e9 steps; put its mean in its place, "
      "or simulate a shorter time",
      last_->of->function.Describe());
}

}  // namespace unfurl::sim
