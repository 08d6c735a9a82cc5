#pragma once

#include <string>
#include <utility>
#include <vector>

#include "cli/verb.h"
#include "measure/live.h"

namespace unfurl::cli {

// `unfurl reconstruct --live`: options of its own beside the verb's.
struct LiveSettings {
  bool live = false;
  std::string trial;          // empty: a stream
  std::string listen;         // HOST:PORT; empty: standard input
  std::string like;           // a record that shows how fast marks are and where they go
  std::string rig, report;    // the verb's
  double camera_shift = 0.0;  // [px], likewise
  double timeout = 10.0;      // [s] without a line: longer than any round of a strobe; 0: for ever
  measure::LiveOptions options;
};

void AddLiveOptions(Verb* verb, LiveSettings* s);

using GivenOptions = std::vector<std::pair<const char*, bool>>;  // name, and whether it was given

// Throws Error for options that need the whole record.
void RefuseWithLive(const GivenOptions& options);
// Throws Error for options that matter to --live only, and were given without it.
void CheckNotLive(const LiveSettings& s);

// Follows the stream to its end; the exit code.
int RunLive(const Common& common, const LiveSettings& s);

}  // namespace unfurl::cli
