#pragma once

#include <cstdint>
#include <vector>

#include "correlate/align/registration.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

// What a model does between the samples of a record. Where it moves faster than they show, motions
// of other frequencies pass through the same samples: a fit has a minimum at each, and what is left
// of a wrong one is as white as noise.

/// By series of a record (RowLayout) and sample.
struct BetweenSamples {
  /// 1: about here the model moves between samples by what they do not show.
  std::vector<std::vector<std::uint8_t>> hidden;
  std::size_t samples = 0;  ///< how many are
  /// RMS of what they do not show, there, over that of their series' residuals [-].
  double times = 0.0;
  /// What another minimum is told by, where the model moves so.
  enum class Told {
    kByNothing,    ///< the residuals have no stated size
    kBySize,       ///< they are of the size that was stated; no more was looked at
    kOneMinimum,   ///< starts over what the other samples leave open came back to one
    kByWhatShows,  ///< they did not: the errors are those of the other samples
    kBySearch,     ///< they did not, and those leave a parameter open: the bounds are looked over
  };
  Told told = Told::kByNothing;
};

/// Where the marks are needed for it: about each sample at half steps of its series. Quantities of
/// channels are known between readings as they are. Nothing beyond the last stamp of `stamps`,
/// which are the observations' own by the model's clock.
Stamps StampsBetween(const Stamps& stamps);

/// `prediction` is that of `reference`, `between` that of StampsBetween. Each sample is foretold
/// from the eight about it, half a step away and then a step from each other, by the polynomial
/// through them, for the model's own motion; `residual` is in the samples' own sigmas.
BetweenSamples LookBetween(const Observations& observations, const Prediction& prediction,
                           const Prediction& between, const Clock& reference,
                           const Registration& at, const Eigen::VectorXd& residual);

}  // namespace unfurl::correlate
