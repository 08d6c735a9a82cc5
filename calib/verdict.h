#pragma once

#include "calib/calibrate.h"
#include "data/rig.h"

namespace unfurl::calib {

inline constexpr char kGood[] = "good";
inline constexpr char kWithCare[] = "usable with care";
inline constexpr char kDoNotUse[] = "do not use";

// The error of a found point that is aimed at [m]: options.need, or its default, a 2000th of the
// longest side of the surveyed box, about what one pixel of a row of 2000 sees of it.
double NeedOf(const VerdictOptions& options, const data::Rig& rig);

// Fills rig.checks, rig.verdict and rig.reasons from the report.
void Judge(const CalibrationReport& report, const Observations& data, data::Rig* rig,
           const VerdictOptions& options = {});

}  // namespace unfurl::calib
