#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"

namespace unfurl::correlate {

/// A mark that could be recorded, and in which lines.
struct PlannedMark {
  std::string name;
  std::vector<double> t;  ///< n stamps of the record's clock, ascending [s]
  std::vector<int> slot;  ///< n, of the strobe's cycle
};

/// A switch that could time every event of a kind at a place.
struct PlannedSwitch {
  std::string name;
  std::string kind;    ///< as TimedEvent
  std::string where;   ///< the joint, or the watch
  double sigma = 0.0;  ///< > 0 [s]
};

/// All that could be recorded in a trial to come, from which a part is chosen.
struct PlannedContent {
  std::vector<PlannedMark> marks;
  /// Their readings are not looked at.
  std::vector<ChannelRecord> channels;
  std::vector<PlannedSwitch> switches;
  bool events = true;  ///< those of the record at hand are timed again
};

/// A record as it would be (kinds: channels, switches, events at hand) where the model is right and
/// nothing scatters: positions and readings as predicted, with the errors that the record at hand
/// has where its marks pass nearest, its frame and clock. `found`: its part of a fit with these
/// options. Throws Error where the model cannot be evaluated.
Observations PlanRecord(const Model& model, const std::vector<double>& theta,
                        const PlannedContent& content, const Observations& like,
                        const TrialResult& found, const FitOptions& options);

}  // namespace unfurl::correlate
