#pragma once

#include <nlohmann/json_fwd.hpp>

#include "campaign/answers.h"

namespace unfurl::campaign {

/// Answers for machines: numbers, intervals [low, high], null where there is none.
nlohmann::ordered_json AnswersJson(const CampaignAnswers& answers);

}  // namespace unfurl::campaign
