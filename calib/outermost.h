#pragma once

#include <vector>

#include "calib/bundle.h"
#include "calib/observations.h"
#include "calib/refine.h"
#include "calib/trends.h"

namespace unfurl::calib {

/// Readings that were left out where their camera has no others near: there the model itself rests
/// on extrapolation, and a lens that does not follow it looks the same as a reading that is wrong.
/// Of each camera with such readings one trend, found: the point and the residual of the one that
/// is off by most. Those that no lens is off by (options.lens_share) are wild wherever they are.
std::vector<Trend> FindOutermost(const Observations& data, const RefinedBundle& bundle,
                                 const TrendOptions& options = {});

}  // namespace unfurl::calib
