#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace unfurl::campaign {

/// JSON has no infinity and no NaN: null stands for a number that is none.
inline nlohmann::ordered_json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

/// That back; `none` for null.
inline double NumberOr(const nlohmann::ordered_json& value, double none) {
  return value.is_null() ? none : value.get<double>();
}

}  // namespace unfurl::campaign
