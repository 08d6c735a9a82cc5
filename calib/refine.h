#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/covariance.h"
#include "calib/gross.h"
#include "calib/observations.h"
#include "calib/weighting.h"

namespace unfurl::calib {

// Of surveys and waves alike. Readings' worth; with less a camera shares its floor.
inline constexpr double kFewRedundant = 8.0;
inline constexpr double kSettled = 0.02;  // change of a variance that no longer matters [-]
inline constexpr double kRough = 1e-7;    // of the cost, until nothing else changes [-]

/// Of the rounds of a refinement.
struct RefineOptions {
  GrossOptions gross;
  bool choose_gross = true;  // false: what is left out stays as it is
  int rounds = 8;
  // Of each bundle. Some ten are usual; cameras with all terms and rows of 16384 pixels take 200.
  int max_iterations = 300;
};

// A bundle by least squares of what is believed, and what is believed of each kind of datum.
struct RefinedBundle {
  Weighting weighting;
  BundleState state;
  BundleSummary summary;
  Redundancy redundancy;
  std::vector<int> ambiguous;  // points of which the wrong thing may have been left out
  double price = 0.0;          // GrossChoice::price at the end; 0 where nothing was chosen [-]
};

// From a robust solution: in turn, which readings and surveyed points to believe (ChooseGross), the
// bundle of those, and the variances: each camera's floor, raised until its readings' squared
// residuals are as large as their redundancy says, and one factor on the survey's sigmas, likewise
// but never below 1. Both only where chance would not do it (5% and 0.1%): a floor that followed
// every upward chance would make all error bars too wide. [variance components: Foerstner 1979]
RefinedBundle Refine(const Observations& data, const std::vector<CameraPrior>& priors,
                     const Weighting& weighting, const RefineOptions& options, BundleState state);

// Where the refinement starts: each camera's readings at about their stated sigmas, if the gross
// errors that this asks for are a plausible share of its readings and of the survey; else its floor
// is from the median of its residuals. The first finds small gross errors, which would otherwise
// hide in the floor; the second is for lenses that are not of the model's kind.
Weighting StartWeighting(const Observations& data, const std::vector<CameraPrior>& priors,
                         double robust_floor_px, const GrossOptions& options,
                         const BundleState& state, const BundleSummary& summary);

}  // namespace unfurl::calib
