#pragma once

#include <string>
#include <vector>

#include "campaign/answers.h"

namespace unfurl::cli {

// What a campaign says, in words.
std::string CampaignText(const campaign::CampaignAnswers& answers);

// In one line: name, runs, design, failures.
std::string CampaignHead(const campaign::CampaignAnswers& answers);

// Tables, header first; the header alone where there is nothing of the kind.
std::vector<std::vector<std::string>> ProbabilityRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> NumberRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> ExtremeRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> ToleranceRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> CorrelationRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> SurrogateRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> ShareRows(const campaign::CampaignAnswers& answers);
std::vector<std::vector<std::string>> ScreeningRows(const campaign::CampaignAnswers& answers);

}  // namespace unfurl::cli
