#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/progress.h"
#include "campaign/campaign.h"
#include "campaign/slurm_engine.h"

namespace unfurl::cli {

// "12 of 40 runs".
std::string CampaignNote(std::uint64_t done, std::uint64_t runs);

// Into how many shards a campaign is cut so that each takes so many seconds, by some runs here,
// which are kept.
std::uint64_t ShardsByPilot(const campaign::OpenCampaign& campaign,
                            const campaign::EngineOptions& options, double seconds);

// How far it is, here and in Slurm's queue; and that in words.
nlohmann::ordered_json CampaignStatus(const campaign::OpenCampaign& campaign,
                                      const campaign::SlurmJobs& jobs);
std::string CampaignStatusText(const nlohmann::ordered_json& status);

// Until all shards are whole; hands missing ones over again when the queue has run dry.
void WaitForSlurm(const campaign::OpenCampaign& campaign, const campaign::EngineOptions& options,
                  campaign::SlurmJobs* jobs, Progress* progress);

}  // namespace unfurl::cli
