#include "campaign/job.h"

#include "campaign/scene_job.h"
#include "campaign/steps_job.h"
#include "data/beside.h"

namespace unfurl::campaign {

std::unique_ptr<Job> MakeJob(const data::Campaign& plan, std::span<const double> typical,
                             const JobOptions& options) {
  for (const std::string& file : plan.job.files) {
    data::RequireFile(file, plan.job.where + ".files");
  }
  if (plan.job.scene.empty()) return MakeStepsJob(plan, options);
  data::RequireFile(plan.job.scene, plan.job.where + ".scene");
  return MakeSceneJob(plan, typical);
}

}  // namespace unfurl::campaign
