#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"

namespace unfurl::calib {

// The robust stage: one floor for all cameras. A lens model that cannot fit would, weighted by the
// readings' own sigmas, bend the survey along its weakest directions. So a floor is added in
// quadrature to every reading's sigma and raised until chi-square per degree of freedom is one;
// where it is below one without, the floor is zero.
struct FlooredBundle {
  double floor_px = 0.0;
  BundleState state;
  BundleSummary summary;
};

// Starts from `state` with a floor of `start_px` that is plainly too large, so that the loss has a
// generous scale first, then searches between that and none. A floor at which the loss would have
// to discard more than `discard_share` of the readings beyond those at the start is too low as
// well.
FlooredBundle SolveWithFloor(const Observations& data, const std::vector<CameraPrior>& priors,
                             double start_px, const BundleOptions& options,
                             const BundleState& state, double discard_share = 0.1);

}  // namespace unfurl::calib
