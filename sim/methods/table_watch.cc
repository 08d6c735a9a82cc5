#include "sim/methods/table_watch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/methods/quartic.h"

namespace unfurl::sim {
namespace {

// Of a table's range, that it may be off, as functions of time (function_watch.cc): with a
// hundredth snaps are seen, but their work is up to 40 tolerances off. The second derivative jumps
// at a knot: what a travel s over it is off by goes with s^2, what its work is off by with s^3. So
// from 1e-6 on, where a thousandth is enough, the part falls as rtol^(2/3).
constexpr double kMostUnseen = 1e-3, kUnseen = 10.0;

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
    : tables_(std::get<JointEffect<MomentTable>>(model.joint_effects)), part_(PartUnseen(rtol)) {}

double TableWatch::PartUnseen(double rtol) {
  return std::min(kMostUnseen, kUnseen * std::pow(rtol, 2.0 / 3.0));
}

double TableWatch::Resolved(const Motion& motion, double h) const {
  for (int k = 0; k < tables_.count(); ++k) {
    const MomentTable& table = tables_.law(k);
    const Coordinate::State at = tables_.coordinate(k).At(motion);
    const double shortest = kShortestTravel * (table.knots().back() - table.knots().front());
    while (std::fabs(at.rate * h) > shortest && !IsSeen(table, at.value, at.rate * h, part_))
      h *= 0.5;
  }
  return h;
}

}  // namespace unfurl::sim
