#pragma once

#include <Eigen/Core>
#include <string>
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

// Of a bar alone the readings tell how its marks divide it, and nothing else is said of its marks'
// distances than what is stated: which of them is wrong nobody knows. `place`: as found [m].
std::string ContradictionOf(const WandData& data, const Eigen::VectorXd& place);
inline constexpr char kContradictionRemedy[] =
    "one of them is wrong, and with it the scale of everything: measure them again, and give them "
    "in the order of the marks' names";

}  // namespace unfurl::calib
