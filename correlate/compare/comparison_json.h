#pragma once

#include <nlohmann/json_fwd.hpp>

#include "correlate/compare/comparison.h"

namespace unfurl::correlate {

// All that a comparison found, in SI units; keys: docs/formats.md.
nlohmann::ordered_json ComparisonJson(const Comparison& comparison);

}  // namespace unfurl::correlate
