#include "cli/reconstruct_events.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "correlate/align/align.h"
#include "data/formats.h"
#include "data/run.h"

namespace unfurl::cli {

std::vector<double> EventTimes(const std::string& events, const data::Tracks& tracks) {
  std::vector<double> times;
  if (events.empty()) return times;
  if (data::FormatOf(events) != data::FileFormat::kHdf5) {
    for (const std::string& word : Split(events, ',')) {
      double t = 0.0;
      if (!ParseDouble(Trim(word), &t) || !std::isfinite(t)) {
        throw Error(fmt::format("'{}' is no time", word), "--events",
                    "list seconds on the record's clock, as in 0.92,1.13, or name a run (.h5)");
      }
      times.push_back(t);
    }
  } else {
    const data::Run run = data::ReadRun(events);
    std::vector<std::string> common;
    for (const std::string& mark : run.marks) {
      if (tracks.FindMark(mark) >= 0) common.push_back(mark);
    }
    if (common.empty()) {
      throw Error("has no mark of the trial's", events,
                  fmt::format("the trial's marks are {}", JoinWords(tracks.marks)));
    }
    const correlate::Alignment alignment = correlate::Align(correlate::FromTracks(tracks, common),
                                                            correlate::SampledModel(run, common));
    if (!alignment.Usable()) {
      throw Error("cannot be aligned with the trial: " + alignment.message, events,
                  "give the times of the events themselves, as in --events 0.92,1.13");
    }
    for (const data::RunEvent& event : run.events) {
      if (event.kind == "latch") times.push_back(event.t + alignment.at.offset);
    }
  }
  std::sort(times.begin(), times.end());
  return times;
}

}  // namespace unfurl::cli
