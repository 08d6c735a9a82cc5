#pragma once

#include <string>

#include "campaign/answers.h"
#include "campaign/record.h"
#include "data/provenance.h"

namespace unfurl::cli {

// A campaign's answers with pictures: probabilities, distributions, what they hang on, how sharp
// they are, what failed. `record_path`: the file that holds the runs.
void WriteCampaignPage(const std::string& path, const campaign::CampaignRecord& record,
                       const campaign::CampaignAnswers& answers, data::Provenance provenance,
                       const std::string& record_path);

}  // namespace unfurl::cli
