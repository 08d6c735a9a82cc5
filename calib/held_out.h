#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/calibrate.h"
#include "calib/observations.h"
#include "calib/refine.h"

namespace unfurl::calib {

struct HeldOutResult {
  std::vector<HeldOutPoint> points;  // by point
  int unsolved = 0;
};

// Calibrates `folds` times without every folds-th point (from the solution of all, with its
// weighting), then finds those points from their readings and compares them with the survey. What
// the fit of all points took for gross errors is not counted here. Folds run in parallel.
HeldOutResult CheckHeldOut(const Observations& data, const std::vector<CameraPrior>& priors,
                           const RefinedBundle& full, int folds, std::size_t workers);

}  // namespace unfurl::calib
