#pragma once

#include <string>
#include <vector>

#include "calib/known_lens.h"
#include "calib/wand_data.h"
#include "calib/wand_fit.h"

namespace unfurl::calib {

// 2 ln of odds of a million to one, by which one explanation is preferred to another [-].
inline constexpr double kPreferred = 27.6;

// The lens model of them all. Error where a camera of the bar is not among them, has another row,
// or the models differ; rows that are not stated are those of the calibration before.
data::LensModel RequireLenses(const std::vector<KnownLens>& known, const std::string& where,
                              WandData* data);

// Lenses from a calibration before in the place of their priors, and the robust bundle with them.
// They are of the cameras as they are: terms odd in y tell the rig from its mirror image, which is
// taken where it explains the readings better; `handed` where that is beyond doubt. The scale of the
// residuals, as RobustWand [px].
double TakeLenses(const std::vector<KnownLens>& known, const BundleOptions& options, WandFit* fit);

}  // namespace unfurl::calib
