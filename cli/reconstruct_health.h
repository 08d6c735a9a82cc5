#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "data/trial_health.h"
#include "report/page.h"

namespace unfurl::cli {

// What is wrong and what was done about it, for a person, a line each; and for --json.
std::string HealthText(const data::TrialHealth& health, nlohmann::ordered_json* summary);
// How much of a page's praise is left by what vouches for the cameras, and its words.
report::Level AddVouching(const data::TrialHealth& health, std::vector<std::string>* details);
// Charts over time by camera, and the faults.
void AddHealth(const data::TrialHealth& health, report::Page* page);

}  // namespace unfurl::cli
