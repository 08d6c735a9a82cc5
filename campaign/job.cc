#include "campaign/job.h"

#include "campaign/scene_job.h"
#include "campaign/steps_job.h"

namespace unfurl::campaign {

std::unique_ptr<Job> MakeJob(const data::Campaign& plan, std::span<const double> typical,
                             const JobOptions& options) {
  if (plan.job.scene.empty()) return MakeStepsJob(plan, options);
  return MakeSceneJob(plan, typical);
}

}  // namespace unfurl::campaign
