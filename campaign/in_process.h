#pragma once

#include <cstddef>

#include "campaign/job.h"
#include "campaign/record.h"

namespace unfurl::campaign {

/// Runs a whole plan in threads of this program, without files: for the library's users. The
/// numbers are those that any engine of `unfurl campaign` gives. `workers` 0: all cores. Throws
/// Error for what the plan or its scene is not, and for designs whose runs hang on earlier ones.
CampaignRecord RunInProcess(const data::Campaign& plan, const JobOptions& options = {},
                            std::size_t workers = 0);

}  // namespace unfurl::campaign
