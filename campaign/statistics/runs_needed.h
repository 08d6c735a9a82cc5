#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

enum class AnswerKind { kMean, kProbability, kQuantile };

/// An answer, and how exact it is wanted.
struct Wanted {
  AnswerKind kind = AnswerKind::kMean;
  double p = 0.5;           // of a quantile
  double half_width = 0.0;  // of its interval, in its own unit; 0: only tell how it falls
  double confidence = 0.95;
};

/// The answer from the first n runs.
struct AnswerAt {
  std::size_t n = 0;
  double value = 0.0, half_width = 0.0;  // infinite where there are too few runs for an interval
};

/// How an answer's error falls, and how many runs it needs.
struct RunsEstimate {
  std::vector<AnswerAt> history;  // first 1/16, 1/8, 1/4, 1/2 of the runs, and all of them
  bool met = false;               // half_width is not above what is wanted
  /// Runs until it is met, by the law of independent runs: error as n^-1/2. Latin and Sobol
  /// designs need no more.
  double runs = 0.0;
  /// Slope of log half width over log n in the history; about -0.5 for independent runs, steeper
  /// for designs that pay. NaN where fewer than three sizes have an interval.
  double slope = 0.0;
};

/// From runs in the order of their index (Design), with their blocks (empty: independent); NaN is
/// a failed run.
RunsEstimate RunsNeeded(const Wanted& wanted, std::span<const double> values,
                        std::span<const int> block = {});

}  // namespace unfurl::campaign
