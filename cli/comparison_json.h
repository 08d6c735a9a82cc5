#pragma once

#include <nlohmann/json_fwd.hpp>

#include "cli/comparison.h"

namespace unfurl::cli {

// All that a comparison found, in SI units; keys: docs/formats.md.
nlohmann::ordered_json ComparisonJson(const Comparison& comparison);

}  // namespace unfurl::cli
