#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "sim/record/run_recorder.h"

namespace unfurl::sim {

// A run in words, in an engineer's order: what latched, margins and loads, then how far the
// numbers can be trusted, then what they cost.
struct SummaryInput {
  const Model& model;
  const SimulateReport& report;  // with steps == 0: interrupted
  const RunRecorder& recorder;
  std::string status;   // "good", "interrupted", ...
  std::string message;  // why, if not good
  std::string scene;    // path
  std::string name;     // of the scene
  std::string out;      // the file written
  bool profile = false;
  const Certificate* certificate = nullptr;  // after the run; null: none was asked for
};

// "4 bodies, 1 latch": what the scene called for, in the model's order.
std::string EffectsText(const Model& model);

// Of the model and of the run: all, or of many the first and how many more there are.
std::vector<std::string> ShownWarnings(const SummaryInput& in);
// "all 4 latches closed, the last at 1.93 s (joint4)".
std::string LatchSentence(const SummaryInput& input);
// "87.4 N", or that it is not known; whether that of `a` is the smaller one.
std::string PinForceText(const SimulateReport& report, std::size_t joint, const char* unit);
bool PinForceLess(const SimulateReport& report, std::size_t a, std::size_t b);
// Rows for a table of joints, header first; `most` rows at most, those with the largest loads.
std::vector<std::vector<std::string>> JointTable(const SummaryInput& input, std::size_t most,
                                                 std::size_t* left_out);
// "error 92 % (mostly beam 'beam2'), contact 6 %".
std::string LimitSentence(const SummaryInput& input);

// The words; fills `json` with the same facts.
std::string SummaryText(const SummaryInput& input, nlohmann::ordered_json* json);

}  // namespace unfurl::sim
