#pragma once

#include <string>

#include "data/campaign.h"

namespace unfurl::data {

// Parts of ReadCampaign. Each throws Error (file:line:key).

// [job], and all steps.
void ReadCampaignJob(const TomlTable& job, Campaign* plan);
// [response.NAME] ..
void ReadCampaignResponses(const TomlTable& root, Campaign* plan);

// Refuses what cannot stand in an expression, or is taken there.
void CheckCampaignName(const TomlTable& t, const std::string& name);

}  // namespace unfurl::data
