#pragma once

#include <string>
#include <vector>

#include "correlate/align/align.h"

namespace unfurl::correlate {

/// One simple cause that would take most of what two records differ by.
struct Explanation {
  /// What is told.
  enum class Kind { kClock, kLengths, kNames, kMark };
  Kind kind = Kind::kClock;
  double value = 0.0;              ///< by how much the clock runs fast, ratio of lengths [-]
  std::vector<std::string> marks;  ///< whose names are exchanged, or the one that is apart
  double left = 0.0;               ///< RMS distance that would be left [m]
  std::string words;
};
const char* Name(Explanation::Kind kind);

/// What is asked of two records that were aligned, or could not be.
struct ExplanationOptions {
  AlignOptions align;
  bool clock = true;    ///< a clock may run fast, and nobody said how fast
  bool lengths = true;  ///< one of the two was measured
};

/// Tries one cause at a time, each with a new frame and offset, on 20,000 samples at most: a clock
/// at another rate, lengths all longer by one factor, two marks whose names are exchanged, a mark
/// that is not where the reference has it. Those that leave at most a quarter of what the squared
/// distance has beyond the measurement's own error, the best first; a mark that is apart where the
/// others agree within their error, or to a tenth where none is known. Of records that were not
/// aligned only names are tried, of six marks at most. Empty: nothing simple, or nothing to
/// explain.
std::vector<Explanation> ExplainDifference(const Observations& record,
                                           const SampledModel& reference,
                                           const Alignment& alignment,
                                           const ExplanationOptions& options);

}  // namespace unfurl::correlate
