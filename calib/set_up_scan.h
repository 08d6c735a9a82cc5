#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"

namespace unfurl::calib {

/// What looking for parts of a survey that are off gave.
struct SetUpScan {
  Trend trend;                 // of the least probable part, of the kind kSurveyShape
  Eigen::MatrixXd covariance;  // what parts that may be off add to that of the cameras, 31 c x 31 c
};

/// Whether a part of the points is off from the others by one rigid motion and a scale, as those of
/// a second set-up of the station are, or of distances that were measured otherwise. Where no
/// set-ups are named parts are what lies on one side of planes across 49 directions, and what comes
/// after a line of the file: each by the score of its seven unknowns after the fit, a chi-square of
/// seven. Of named set-ups the motion is in the fit, and each but the first has its scale tested.
/// With Sidak's price for all parts. Of the least probable the chance and, below the level, what it
/// does to found points, as for a Trend.
///
/// A part that is off by some sigma of a point shows in no residual and moves found points by more
/// than their error bars. Where no set-up is named, not the only one either, one is therefore taken
/// to be there with even odds before the residuals speak, and its second moment after they spoke,
/// over all parts and sizes, is the covariance; zero where they are.
SetUpScan ScanSetUps(const Observations& data, const std::vector<CameraPrior>& priors,
                     const RefinedBundle& bundle, const TrendOptions& options = {});

}  // namespace unfurl::calib
