#pragma once

#include "calib/check.h"
#include "calib/check_design.h"
#include "calib/joint_test.h"

namespace unfurl::calib {

// Fills result->causes and explained, and says in the reasons what explains the misfit: cameras,
// points, readings, the frame. Where only points and readings are to blame the rig may stand, and
// the verdict is "doubtful".
void NameCauses(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                const Observations& data, bool bar, CheckResult* result);

// Says which shift of a camera the check would have shown.
void NoteShown(CheckResult* result);

}  // namespace unfurl::calib
