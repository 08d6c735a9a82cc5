#pragma once

#include <string>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/hierarchy/hierarchy.h"

namespace unfurl::correlate {

/// A trial that was fitted by itself.
struct FittedTrial {
  const FitTrial* trial = nullptr;
  const FitResult* result = nullptr;  ///< of a problem of that trial alone
};

/// What trials fitted one by one give to a hierarchy.
struct FittedTrials {
  HierarchyProblem problem;           ///< in the coordinates that the solver moves
  std::vector<std::size_t> used;      ///< which of the fits
  std::vector<std::string> left_out;  ///< of the others, in words, why
};

/// Each trial's values and the covariance of its own errors, apart from what all have in common:
/// the model's own error, and the calibration's where all were reconstructed with one. A fit that
/// is not usable, leaves a parameter open, or ends at a bound is left out: it has no estimate with
/// a normal error. `scatters` as in HierarchyProblem.
FittedTrials FromFits(const std::vector<Parameter>& parameters,
                      const std::vector<FittedTrial>& fits, std::vector<bool> scatters = {});

}  // namespace unfurl::correlate
