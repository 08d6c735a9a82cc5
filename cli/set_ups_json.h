#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "calib/set_up.h"

namespace unfurl::cli {

// `set_ups` of a calibration's summary: a list, an entry for each set-up but the first.
nlohmann::ordered_json SetUpsJson(const std::vector<calib::SetUpEstimate>& set_ups);

}  // namespace unfurl::cli
