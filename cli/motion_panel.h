#pragma once

#include <optional>
#include <string>
#include <vector>

#include "correlate/compare/comparison.h"
#include "data/run.h"
#include "report/motion.h"

namespace unfurl::cli {

// A run as a moving picture: bodies, beams, joints with their latches and contacts, and these
// marks; times are the run's own plus `offset` [s]. Nothing where the run keeps no shapes
// (--shape-rate 0, or a program before 0.1). Reads what is shown alone, whatever the run's length.
std::optional<report::Motion> MotionOfRun(const data::RunReader& run,
                                          const std::vector<std::string>& marks,
                                          double offset = 0.0);

// The same of a run in memory, of which every picture is shown.
std::optional<report::Motion> MotionOfRun(const data::Run& run,
                                          const std::vector<std::string>& marks,
                                          double offset = 0.0);

// A comparison's marks, measured and computed, where there is no structure to draw; nothing where
// there are fewer than two samples.
std::optional<report::Motion> MotionOfMarks(const correlate::Comparison& comparison);

// The measured marks of a comparison over the reference in motion, by the record's clock; without
// a structure to draw as MotionOfMarks.
std::optional<report::Motion> MotionOfBoth(const correlate::Comparison& comparison,
                                           std::optional<report::Motion> reference);

// Evenly spaced frames over all marks of a motion that has none; whether there is a time to show.
bool SpanFrames(report::Motion* motion);

}  // namespace unfurl::cli
