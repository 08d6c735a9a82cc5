#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"
#include "data/rig.h"

namespace unfurl::calib {

/// What a lens makes beyond the highest order of its model, were that a third of the highest, as
/// each order's prior is of the one before. The fit takes most of it up where there are points, so
/// no residual shows it; at the ends of the rows, just beyond the outermost points, it does not.
///
/// Of each camera whose fit has terms of that order; `rise` is the share by which squared errors of
/// points anywhere in the surveyed box then exceed what the rig states, `rms` what the highest
/// order makes at the outermost reading [px]. Found is the camera with the largest share, if all
/// together exceed options.harmless. Empty where no camera has such terms.
std::vector<Trend> FindLensRest(const Observations& data, const std::vector<CameraPrior>& priors,
                                const RefinedBundle& bundle, const data::Rig& rig,
                                const TrendOptions& options = {});

}  // namespace unfurl::calib
