#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "calib/calibrate.h"

namespace unfurl::cli {

// What `unfurl calibrate --json` prints of a survey's calibration; the files it was of and went to.
nlohmann::ordered_json CalibrationJson(const calib::Calibration& result, const std::string& survey,
                                       const std::string& rig);

}  // namespace unfurl::cli
