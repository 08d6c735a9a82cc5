#pragma once

#include <functional>
#include <string>

#include "campaign/campaign.h"
#include "campaign/statistics/runs_needed.h"

namespace unfurl::campaign {

/// How sharp an answer is to be.
struct Goal {
  AnswerKind kind = AnswerKind::kMean;
  std::string response;
  double p = 0.5;         ///< of a quantile [-]
  double half = 0.0;      ///< half the interval wanted [unit of the response; -]
  bool relative = false;  ///< `half` is a part of the answer itself
};

/// "P(latched) +- 0.002", "mean(peak) +- 1%", "quantile(peak, 0.99) +- 20". Throws Error at `where`
/// for what is none, or names no response of the plan that has such an answer.
Goal ParseGoal(const std::string& text, const data::Campaign& plan, const std::string& where);

/// Computes what is missing of a campaign's runs, by whatever engine.
using RunMissing = std::function<EngineReport(const OpenCampaign&)>;

/// Adds runs until the goal of the plan (campaign.until) is met, or campaign.most are done. Each
/// time as many as the answer so far calls for, half as many again at least, since an error that is
/// found small by chance must not end it at once.
EngineReport GrowUntil(OpenCampaign* campaign, const RunMissing& run);

}  // namespace unfurl::campaign
