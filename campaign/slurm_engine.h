#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "campaign/engine.h"

namespace unfurl::campaign {

/// A job array that was handed to Slurm. Its task k computes shard `offset` + k.
struct SlurmArray {
  std::string job;           ///< as Slurm numbers it
  std::uint64_t offset = 0;  ///< of its tasks
};

/// What of a campaign Slurm has; lies in the campaign's folder.
struct SlurmJobs {
  std::uint64_t shards = 0;  ///< into which the runs are cut; 0: nothing was handed over
  std::vector<SlurmArray> arrays;
};

/// Reads and writes that.
SlurmJobs ReadSlurmJobs(const CampaignFolder& folder);
void WriteSlurmJobs(const CampaignFolder& folder, const SlurmJobs& jobs);

/// Shards that are not whole in the folder.
std::vector<std::uint64_t> MissingShards(const CampaignFolder& folder, std::uint64_t runs,
                                         std::uint64_t shards);

/// The script of one array, whose tasks it takes from the environment.
std::string SlurmScript(const CampaignFolder& folder, std::uint64_t shards,
                        const EngineOptions& options);

/// Hands over the shards that are missing and not in Slurm's queue. Returns how many. Throws Error
/// where Slurm is not there, or refuses.
std::uint64_t SubmitToSlurm(const CampaignFolder& folder, std::uint64_t runs,
                            const std::vector<std::string>& sbatch_options,
                            const EngineOptions& options, SlurmJobs* jobs);

/// Tasks in the queue by state ("RUNNING", "PENDING", ...).
std::map<std::string, std::uint64_t> SlurmStates(const SlurmJobs& jobs);

/// Takes back all that is in the queue.
void CancelSlurm(const SlurmJobs& jobs);

}  // namespace unfurl::campaign
