#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "data/fit.h"

namespace unfurl::cli {

// For the terminal, and for --json.
std::string FitText(const data::FitRecord& record, double seconds);
nlohmann::ordered_json FitJson(const data::FitRecord& record, const std::string& output,
                               double seconds);

}  // namespace unfurl::cli
