#pragma once

#include <string>

#include "data/lab.h"
#include "data/rig.h"

namespace unfurl::calib {

// How the cameras that a calibration found stand against where they were meant to stand. Readings
// cannot tell a world from its mirror image (a mirrored camera reads alike); a layout can, and with
// it a survey in the left-handed order N, E, H is found out.
struct LayoutMatch {
  // Of places, and of points along the optical axes as far away as the cameras are from their
  // middle, after a rigid fit [m].
  double rms = 0.0;
  double rms_mirrored = 0.0;  // the same of the mirrored rig
  bool mirrored = false;
};
// Throws Error when a camera of the rig is not in the lab.
LayoutMatch CompareLayout(const data::Rig& rig, const data::Lab& lab);

// Stores the match among the rig's checks; "do not use" where the survey is the mirror image.
void JudgeLayout(const data::Lab& lab, data::Rig* rig);

}  // namespace unfurl::calib
