#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "data/fit.h"

namespace unfurl::cli {

// A fit of many trials that scatter, for the terminal and for --json.
std::string RepeatText(const data::FitRecord& record, double seconds);
nlohmann::ordered_json RepeatJson(const data::FitRecord& record, const std::string& output,
                                  double seconds);

}  // namespace unfurl::cli
