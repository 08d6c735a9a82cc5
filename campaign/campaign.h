#pragma once

#include <memory>
#include <string>
#include <vector>

#include "campaign/engine.h"
#include "campaign/folder.h"
#include "campaign/inputs.h"
#include "campaign/job.h"

namespace unfurl::campaign {

/// A plan with its folder, ready to be computed, looked at or merged.
struct OpenCampaign {
  Inputs inputs;
  CampaignFolder folder;
  std::vector<std::string> files;  ///< that the runs depend on
  std::unique_ptr<Job> job;

  /// One response of all runs, which are all there; NaN of those that have none [unit].
  std::vector<double> Values(std::size_t response) const;
  /// The same campaign with more runs, of a design to which runs can be added.
  void Extend(std::uint64_t runs);
};

/// From a plan, whose folder is made (or taken up, where it is of the same plan and scene). Tries
/// the job's names at the medians first. Throws Error.
OpenCampaign OpenPlan(const data::Campaign& plan, const std::string& folder,
                      const JobOptions& options);

/// From a folder. Throws Error where a file that the runs depend on has changed since.
OpenCampaign OpenFolder(const std::string& folder, const JobOptions& options);

/// Computes some runs into a part of the folder, unless it is there.
void ComputePart(const OpenCampaign& campaign, const RunRange& range,
                 const std::function<void(std::uint64_t)>& progress = {});

}  // namespace unfurl::campaign
