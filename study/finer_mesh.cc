#include "study/finer_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::study {

namespace {

// Orders of convergence, docs/physics-simulator.md: of segments in their length, of smooth beams in
// the number of modes (the worst case, clamped at both ends).
constexpr double kSegmentOrder = 2.0, kModeOrder = 3.5;
// Ratio of segment lengths. A run costs about its third power (stiffer and larger); nearer to 1,
// Richardson's factor magnifies the scatter of both runs (1.8 times at 1.5, 5.8 at 1.1).
constexpr double kFiner = 1.5;
constexpr int kMoreModes = 2;  // one of either parity

double Richardson(double gain) { return gain / (gain - 1.0); }

FinerMesh AsGiven(const data::StudyMeshCheck& check) {
  FinerMesh out;
  for (const std::string& key : check.keys) {
    out.set.push_back(fmt::format("{}={:.17g}", key, check.value));
  }
  out.factor = Richardson(std::pow(check.spacing_ratio, check.order));
  return out;
}

}  // namespace

FinerMesh FinerMeshOf(const data::StudyMeshCheck& check,
                      const std::vector<data::SceneBeam>& beams) {
  if (!check.wanted) return {};
  if (!check.keys.empty()) return AsGiven(check);
  FinerMesh out;
  double least = std::numeric_limits<double>::infinity();  // by what the error falls
  for (const data::SceneBeam& beam : beams) {
    const bool segments = beam.model == data::BeamModel::kSegments;
    const int coarse = segments ? beam.segments : beam.order;
    const int most = segments ? data::kMostSegments : data::kHighestOrder;
    const int fine = std::min(
        most, segments ? static_cast<int>(std::ceil(kFiner * coarse)) : coarse + kMoreModes);
    if (fine == coarse) continue;
    const double ratio = static_cast<double>(fine) / coarse;
    least = std::min(least, std::pow(ratio, segments ? kSegmentOrder : kModeOrder));
    out.set.push_back(
        fmt::format("beam.{}.{}={}", beam.name, segments ? "segments" : "order", fine));
  }
  if (!out.set.empty()) out.factor = Richardson(least);
  return out;
}

}  // namespace unfurl::study
