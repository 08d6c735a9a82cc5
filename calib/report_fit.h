#pragma once

#include "calib/calibrate.h"
#include "calib/observations.h"

namespace unfurl::calib {

/// The fit's numbers into its report, reading by reading and camera by camera. `set_up_level`: of
/// the test whether parts of the survey are off, as VerdictOptions.
void ReportFit(const Observations& data, const RigFit& fit, double set_up_level,
               CalibrationReport* report);

}  // namespace unfurl::calib
