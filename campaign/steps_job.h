#pragma once

#include "campaign/job.h"

namespace unfurl::campaign {

/// Commands that are run one after another in a folder of their own. Throws as MakeJob.
std::unique_ptr<Job> MakeStepsJob(const data::Campaign& plan, const JobOptions& options);

}  // namespace unfurl::campaign
