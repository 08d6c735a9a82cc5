#pragma once

#include <string>

#include "calib/calibrate.h"
#include "data/survey.h"

namespace unfurl::calib {

/// From a survey to a rig in one call. Readings of raw lines are found first; what the survey says
/// of its station (place, errors of distance and angle) enters. `where` names the survey in
/// messages. `used`, unless null, gets the observations that entered the calibration, points
/// that were surveyed metres away from where they are (CalibrationReport::far) at their places.
/// Throws Error where the survey cannot determine a rig, Interrupted after Ctrl-C; a calibration
/// that is not good is a result, with verdict and reasons in its rig.
Calibration Calibrate(data::Survey survey, CalibrateOptions options = {},
                      const std::string& where = "survey", Observations* used = nullptr);

}  // namespace unfurl::calib
