#include "study/unit_check.h"

#include <string_view>

#include "base/error.h"
#include "correlate/align/unit_doubt.h"
#include "correlate/sampled_model.h"

namespace unfurl::study {

namespace {

// A ratio beyond this is nearer to a thousand than to one.
constexpr double kNearerToThousand = 31.6;

// The first sample of each mark: of the structure before it moves, more or less.
correlate::Observations Beginning(const correlate::Observations& all) {
  correlate::Observations out = all;
  for (correlate::MarkSeries& m : out.marks) {
    m.t.resize(1);
    m.p = m.p.leftCols(1).eval();
  }
  return out;
}

}  // namespace

void RefuseOtherUnits(const correlate::Observations& record, const SceneModel& model,
                      std::span<const double> theta, const std::string& tracks) {
  std::vector<std::string> marks;
  for (const correlate::MarkSeries& m : record.marks) {
    if (m.size() == 0) return;
    marks.push_back(m.name);
  }
  // Samples of a run: its highest speed is looked for over a hundredth. One step shows the start.
  constexpr double kSteps = 1000.0;
  auto simulated = [&](double horizon) {
    return correlate::SampledModel(model, theta, marks, 0.0, horizon, horizon / kSteps);
  };
  // 1. Is there reason to look? The record's length, and where the marks are at first.
  bool doubtful = record.End() - record.Start() > kNearerToThousand * model.duration();
  if (!doubtful) {
    const correlate::SampledModel first = simulated(model.duration() / kSteps);
    if (!first.good()) return;  // the fit says why
    correlate::UnitRatios ratios =
        correlate::CompareUnits(Beginning(record), Beginning(first.samples()));
    ratios.time = 0.0;
    doubtful = !correlate::UnitDoubt(ratios).empty();
  }
  if (!doubtful) return;
  // 2. What the marks do over the scene's own duration decides: folded marks may lie together.
  const correlate::SampledModel run = simulated(model.duration());
  if (!run.good()) return;
  std::string doubt = correlate::UnitDoubt(correlate::CompareUnits(record, run.samples()));
  constexpr std::string_view kReference = "reference's";
  for (std::size_t at = 0; (at = doubt.find(kReference)) != std::string::npos;) {
    doubt.replace(at, kReference.size(), "scene's");
  }
  if (doubt.empty()) return;
  throw Error(doubt, tracks, "tracks are in seconds and metres: convert them");
}

}  // namespace unfurl::study
