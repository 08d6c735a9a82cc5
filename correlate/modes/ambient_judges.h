#pragma once

#include "correlate/modes/ambient.h"
#include "correlate/modes/joint_grid.h"

namespace unfurl::correlate {

/// In which the squares and products of a mode's random vibration forget themselves [s].
double MemoryOf(const Mode& mode);

/// Keeps of fit->left_out what is none of the modes, and names it as a doubt; before JudgeRecord.
void JudgeLeftOut(AmbientFit* fit);

/// Of the record as a whole: lines at which something drives the structure, a strength that
/// changes from part to part.
void JudgeRecord(const JointSignals& joint, const AmbientOptions& options, AmbientFit* fit);

/// Of each mode: whether it is one, and whether it stays the same; after JudgeRecord.
void JudgeModes(const JointSignals& joint, const AmbientOptions& options, AmbientFit* fit);

}  // namespace unfurl::correlate
