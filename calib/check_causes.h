#pragma once

#include <vector>

#include "calib/check.h"
#include "calib/check_design.h"
#include "calib/joint_test.h"

namespace unfurl::calib {

// What explains the misfit, and whether it does.
struct FoundCauses {
  std::vector<FoundCause> causes;
  bool explained = false;
};
FoundCauses FindCauses(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                       const CheckOptions& options);

// Fills result->causes and explained, and says in the reasons what explains the misfit: cameras,
// points, readings, the frame. Where only points and readings are to blame the rig may stand, and
// the verdict is "doubtful".
void NameCauses(const data::Rig& rig, const CheckDesign& design, const JointTest& test,
                const FoundCauses& found, const Observations& data, bool bar, CheckResult* result);

// Says which shift of a camera the check would have shown.
void NoteShown(CheckResult* result);

}  // namespace unfurl::calib
