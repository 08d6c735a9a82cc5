#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/known_lens.h"

namespace unfurl::cli {

// What `unfurl calibrate --json` prints of a survey's calibration; the files it was of and went to.
nlohmann::ordered_json CalibrationJson(const calib::Calibration& result, const std::string& survey,
                                       const std::string& rig);

// Of cameras whose lenses were known before; where one went is null where the frame is another.
nlohmann::ordered_json LensesJson(const std::vector<calib::KnownLensEstimate>& lenses);

}  // namespace unfurl::cli
