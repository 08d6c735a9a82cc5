#pragma once

#include <string>
#include <vector>

#include "calib/wand_frame.h"
#include "data/lab.h"
#include "data/rig.h"

namespace unfurl::calib {

/// Where a laboratory means its cameras to stand and to look.
std::vector<WandFrame::Planned> PlannedPlaces(const data::Lab& lab);

/// Cameras of an earlier rig in the order of `names`. Throws Error, with `where`, for one that the
/// rig lacks.
std::vector<data::RigCamera> CamerasOf(const data::Rig& rig, const std::vector<std::string>& names,
                                       const std::string& where);

}  // namespace unfurl::calib
