#pragma once

#include "campaign/job.h"

namespace unfurl::campaign {

/// A scene that is simulated in this process. Throws as MakeJob.
std::unique_ptr<Job> MakeSceneJob(const data::Campaign& plan, std::span<const double> typical);

}  // namespace unfurl::campaign
