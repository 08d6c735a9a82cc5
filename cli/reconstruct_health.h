#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "data/rig.h"
#include "data/trial_health.h"
#include "report/page.h"

namespace unfurl::cli {

// What is wrong and what was done about it, for a person, a line each; and for --json.
std::string HealthText(const data::TrialHealth& health, nlohmann::ordered_json* summary);
// Why positions cannot be used whatever their error bars: readings depart from where the
// calibration puts them by more than anything that sways or warms; empty: they do not.
std::string MisfitTooLarge(const data::TrialHealth& health, const data::Rig& rig);
// How much of a page's praise is left by what vouches for the cameras, and its words.
report::Level AddVouching(const data::TrialHealth& health, std::vector<std::string>* details);
// Charts over time by camera, and the faults.
void AddHealth(const data::TrialHealth& health, report::Page* page);

}  // namespace unfurl::cli
