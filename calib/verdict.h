#pragma once

#include "calib/calibrate.h"
#include "data/rig.h"

namespace unfurl::calib {

inline constexpr char kGood[] = "good";
inline constexpr char kWithCare[] = "usable with care";
inline constexpr char kDoNotUse[] = "do not use";

// Fills rig.checks, rig.verdict and rig.reasons from the report. Each limit stands beside its
// reason in verdict.cc.
void Judge(const CalibrationReport& report, const Observations& data, data::Rig* rig);

}  // namespace unfurl::calib
