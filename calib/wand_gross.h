#pragma once

#include <vector>

#include "calib/wand_fit.h"

namespace unfurl::calib {

// Redundancy of a datum above which its residual tells of its error [-].
inline constexpr double kUsefulRedundancy = 0.1;

// Leaves out, in each pose, the reading that is off by most of its own sigmas, and what is off by
// as much at the same mark, or the whole pose where fewer than four remain there. Of a surveyed
// point the reading that is off, or its place where more than that one is. Whether any were.
bool LeaveOut(double sigmas, WandFit* fit);

// Puts poses, by their number in `data`, on the fit's list of those that contradict the rest.
void CountLost(const WandData& data, const std::vector<int>& poses, WandFit* fit);

// Takes the poses of which no reading takes part any more out of data and state; they are counted
// in `lost`. Whether there were any.
bool DropLostPoses(WandFit* fit);

}  // namespace unfurl::calib
