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

// How far it is, here and in Slurm's queue; and that in words.
nlohmann::ordered_json CampaignStatus(const campaign::OpenCampaign& campaign,
                                      const campaign::SlurmJobs& jobs);
std::string CampaignStatusText(const nlohmann::ordered_json& status);

// Hands over the shards that are missing and not in the queue; returns how many. Where the campaign
// is not cut into shards yet, some runs here, which are kept, tell into how many, so that each takes
// so many seconds.
std::uint64_t HandToSlurm(const campaign::OpenCampaign& campaign,
                          const campaign::EngineOptions& options, double seconds,
                          campaign::SlurmJobs* jobs);

// Until the plan's goal is met: what is missing is handed over and waited for, and runs are added.
void GrowBySlurm(campaign::OpenCampaign* campaign, const campaign::EngineOptions& options,
                 double seconds, campaign::SlurmJobs* jobs, Progress* progress);

// Until all shards are whole; hands missing ones over again when the queue has run dry.
void WaitForSlurm(const campaign::OpenCampaign& campaign, const campaign::EngineOptions& options,
                  campaign::SlurmJobs* jobs, Progress* progress);

}  // namespace unfurl::cli
