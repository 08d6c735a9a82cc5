#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"

namespace unfurl::calib {

/// Where no set-ups are named: whether a part of the points is off from the others by one rigid
/// motion, as those of a second set-up of the station are. Parts are what lies on one side of
/// planes across 49 directions, and what comes after a line of the file: each by the score of its
/// six unknowns after the fit, a chi-square of six, with Sidak's price for all parts. Of the least
/// probable the chance and, below the level, what it does to found points, as for a Trend; of the
/// kind kSurveyShape. Without text where set-ups are named.
Trend ScanSetUps(const Observations& data, const std::vector<CameraPrior>& priors,
                 const RefinedBundle& bundle, const TrendOptions& options = {});

}  // namespace unfurl::calib
