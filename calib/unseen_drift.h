#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"

namespace unfurl::calib {

/// Steady drifts with the order of measuring that the tests of the residuals may as well miss:
/// first of the surveyed places, then of each camera's readings. Where points are measured in an
/// order that goes with their place, cameras take a drift for their own pose or lens, and no
/// residual shows it.
///
/// Of each `change` [m] or [px] from the first point to the last that is found with even odds, in
/// the direction that harms most (infinite where none is found), and `rise` as it then is. Found is
/// the most harmful one, if its rise is above what is allowed (options.unseen) and nobody says that
/// nothing moved (options.steady); its text says what to do.
std::vector<Trend> FindUnseenDrift(const Observations& data, const std::vector<CameraPrior>& priors,
                                   const RefinedBundle& bundle, const TrendOptions& options = {});

}  // namespace unfurl::calib
