#pragma once

#include <vector>

#include "calib/wand.h"

namespace unfurl::calib {

// Fills rig.checks, rig.verdict and rig.reasons; `sigmas` of found points over the volume, by
// calibration and readings [m].
void JudgeWand(const WandFit& fit, const std::vector<double>& sigmas, const WandReport& report,
               const VerdictOptions& options, data::Rig* rig);

}  // namespace unfurl::calib
