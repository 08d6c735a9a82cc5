#include "study/rungs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/count.h"

namespace unfurl::study {

namespace {

// Order of convergence of segments in their length (docs/physics-simulator.md). Smooth beams have
// none that could be relied on: odd and even numbers of modes come to the limit from either side.
constexpr double kSegmentOrder = 2.0;

// Segments of the upper rungs over those of the scene. Two ratios, so that the order can be seen to
// hold; no more, since a run costs up to the third power.
constexpr double kRatios[] = {1.5, 2.0};

SceneRung Given(const data::StudyFidelity::Rung& from, const data::StudyFidelity::Rung& first,
                const std::vector<data::SceneBeam>& beams) {
  SceneRung out;
  out.set = from.set;
  for (const data::SceneBeam& beam : beams) {
    if (from.segments > 0) {
      out.set.push_back(fmt::format("beam.{}.model=segments", beam.name));
      out.set.push_back(fmt::format("beam.{}.segments={}", beam.name, from.segments));
    } else if (from.order > 0) {
      out.set.push_back(fmt::format("beam.{}.model=kirchhoff", beam.name));
      out.set.push_back(fmt::format("beam.{}.order={}", beam.name, from.order));
    }
  }
  out.error = from.error;
  if (out.error == 0.0 && from.segments > 0 && first.segments > 0 && from.set.empty()) {
    out.error = std::pow(static_cast<double>(first.segments) / from.segments, kSegmentOrder);
  }
  out.name = !from.name.empty()  ? from.name
             : from.segments > 0 ? Counted(static_cast<std::size_t>(from.segments), "segment")
             : from.order > 0    ? fmt::format("smooth beams of order {}", from.order)
             : !from.set.empty() ? from.set.front()
                                 : std::string("the scene as it is");
  return out;
}

// "8 segments", "4 to 8 segments", "smooth beams of order 3".
std::string NameOf(const std::vector<int>& segments, const std::vector<int>& orders) {
  auto range = [](const std::vector<int>& n) {
    const auto [low, high] = std::minmax_element(n.begin(), n.end());
    return *low == *high ? fmt::format("{}", *low) : fmt::format("{} to {}", *low, *high);
  };
  std::string name;
  if (!segments.empty()) name = range(segments) + " segments";
  if (!orders.empty()) {
    name += (name.empty() ? "" : ", ") + ("smooth beams of order " + range(orders));
  }
  return name;
}

// Rung `level` above the scene as it is; level 0 sets nothing.
SceneRung Found(const std::vector<data::SceneBeam>& beams, int level) {
  SceneRung out;
  double least = std::numeric_limits<double>::infinity();  // ratio of segments
  std::vector<int> segments, orders;
  for (const data::SceneBeam& beam : beams) {
    const bool mesh = beam.model == data::BeamModel::kSegments;
    const int coarse = mesh ? beam.segments : beam.order;
    const int most = mesh ? data::kMostSegments : data::kHighestOrder;
    int fine = coarse;
    if (level > 0) {
      fine = std::min(
          most, mesh ? static_cast<int>(std::ceil(kRatios[level - 1] * coarse)) : coarse + level);
    }
    (mesh ? segments : orders).push_back(fine);
    if (mesh) least = std::min(least, static_cast<double>(fine) / coarse);
    if (fine == coarse) continue;
    out.set.push_back(fmt::format("beam.{}.{}={}", beam.name, mesh ? "segments" : "order", fine));
  }
  if (!segments.empty()) out.error = std::pow(least, -kSegmentOrder);
  out.name = NameOf(segments, orders);
  return out;
}

}  // namespace

std::vector<SceneRung> RungsOf(const data::StudyFidelity& fidelity,
                               const std::vector<data::SceneBeam>& beams) {
  std::vector<SceneRung> out;
  for (const data::StudyFidelity::Rung& rung : fidelity.rungs) {
    out.push_back(Given(rung, fidelity.rungs.front(), beams));
  }
  if (!out.empty()) {
    if (!fidelity.wanted) out.resize(1);
    return out;
  }
  if (!fidelity.wanted || beams.empty()) return {};
  for (int level = 0; level <= static_cast<int>(std::size(kRatios)); ++level) {
    SceneRung rung = Found(beams, level);
    if (level > 0 && rung.set == out.back().set) continue;
    out.push_back(std::move(rung));
  }
  return out;
}

}  // namespace unfurl::study
