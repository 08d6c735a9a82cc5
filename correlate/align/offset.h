#pragma once

#include <string>
#include <vector>

#include "correlate/sampled_model.h"

namespace unfurl::correlate {

// Where in time two records fit together, found before anything is known of their frames: by
// signals that no rigid frame changes. These are the distances between marks; where none of them
// varies (one mark, or a rigid body), the speeds of the marks.
struct OffsetOptions {
  double min_overlap = 0.3;  // of the shorter record's samples, in (0, 1] [-]
  int candidates = 3;        // peaks handed on, best first
  // Where to look [s]; the whole range of overlap by default.
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  // Offsets that are known already: what leads to within `near` of one of them is passed over [s].
  std::vector<double> known;
  double near = 0.0;
  bool IsKnown(double offset) const;
};

/// A peak of the correlation.
struct OffsetCandidate {
  double offset = 0.0;       // the clock of `a` shows this when that of `b` shows 0 [s]
  double correlation = 0.0;  // normalised, over all signals together, in [-1, 1]
  double overlap = 0.0;      // share of the shorter record's samples that took part [-]
};

/// What the search found.
struct OffsetSearch {
  std::vector<OffsetCandidate> candidates;  // may be empty: no lag with enough overlap
  std::string signal;                       // in words: what was correlated
  // How many histories that may differ freely: the distances, or 1 for speeds, which one rigid body
  // or one mark makes alike.
  std::size_t independent = 0;
  double step = 0.0;  // of the grid [s]
};

// Both must hold the marks named. Gaps are left out of every sum, not filled (masked normalised
// cross-correlation, by FFT); the peak is refined by a parabola through its three highest lags.
OffsetSearch FindOffset(const SampledModel& a, const SampledModel& b,
                        const std::vector<std::string>& marks, const OffsetOptions& options = {});

}  // namespace unfurl::correlate
