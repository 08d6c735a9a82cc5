#include "sim/methods/table_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/number.h"
#include "sim/methods/quartic.h"

namespace unfurl::sim {
namespace {

// Of a table's range, that it may be off, as functions of time (function_watch.cc): with a
// hundredth snaps are seen, but their work is up to 40 tolerances off. The second derivative jumps
// at a knot: what a travel s over it is off by goes with s^2, what its work is off by with s^3. So
// from 1e-6 on, where a thousandth is enough, the part falls as rtol^(2/3).
constexpr double kMostUnseen = 1e-3, kUnseen = 10.0;

// Of a table's width, that a coordinate may go beyond its points unsaid: a straight line is as good
// as a point measured there [-].
constexpr double kBeyond = 0.01;

// Whether the table from `from` over `travel` is a quartic but for what may be unseen.
bool IsSeen(const MomentTable& table, double from, double travel, double part) {
  const std::vector<double>& knots = table.knots();
  const double low = std::min(from, from + travel), high = std::max(from, from + travel);
  const auto first = std::upper_bound(knots.begin(), knots.end(), low);
  const auto last = std::lower_bound(first, knots.end(), high);
  if (first == last) return true;  // one cubic
  if (last - first > TableWatch::kMostKnots) return false;
  std::array<double, 5> values{};
  for (std::size_t k = 0; k < values.size(); ++k) {
    values[k] = table.At(from + kQuarticPlaces[k] * travel).moment;
  }
  const auto off = [&](double place) {
    return std::fabs(table.At(place).moment - QuarticAt(values, (place - from) / travel));
  };
  const double allowed = part * table.range();
  for (auto knot = first; knot != last; ++knot) {
    const double next = knot + 1 == last ? high : knot[1];
    if (off(*knot) > allowed || off(0.5 * (*knot + next)) > allowed) return false;
  }
  return off(0.5 * (low + *first)) <= allowed;
}

}  // namespace

TableWatch::TableWatch(const Model& model, double rtol)
    : model_(model),
      tables_(std::get<JointEffect<MomentTable>>(model.joint_effects)),
      part_(PartUnseen(rtol)),
      reach_(static_cast<std::size_t>(tables_.count())) {}

double TableWatch::PartUnseen(double rtol) {
  return std::min(kMostUnseen, kUnseen * std::pow(rtol, 2.0 / 3.0));
}

double TableWatch::Resolved(const Motion& motion, double h) {
  for (int k = 0; k < tables_.count(); ++k) {
    const MomentTable& table = tables_.law(k);
    const Coordinate::State at = tables_.coordinate(k).At(motion);
    Reach& reach = reach_[static_cast<std::size_t>(k)];
    reach = {std::min(reach.low, at.value), std::max(reach.high, at.value)};
    const double shortest = kShortestTravel * (table.knots().back() - table.knots().front());
    while (std::fabs(at.rate * h) > shortest && !IsSeen(table, at.value, at.rate * h, part_))
      h *= 0.5;
  }
  return h;
}

std::vector<std::string> TableWatch::Warnings() const {
  std::vector<std::string> out;
  for (const Model::Joint& joint : model_.joints) {
    const int k = joint.effects[JointEffectIndex<MomentTable::Record>()];
    if (k < 0) continue;
    const std::vector<double>& knots = tables_.law(k).knots();
    const Reach& reach = reach_[static_cast<std::size_t>(k)];
    const double over = reach.high - knots.back(), under = knots.front() - reach.low;
    if (!(std::max(over, under) > kBeyond * (knots.back() - knots.front()))) continue;
    const double end = over > under ? knots.back() : knots.front();
    const double reached = over > under ? reach.high : reach.low;
    const bool travel = joint.coordinate.travel;
    out.push_back(fmt::format(
        "the {0} of '{1}' went to {2} {3}, but the points of its table end at {4} {3}: the {5} "
        "beyond them is a straight line's, which nobody measured",
        travel ? "travel" : "angle", joint.name, Number(reached), travel ? "m" : "rad", Number(end),
        travel ? "force" : "moment"));
  }
  return out;
}

}  // namespace unfurl::sim
