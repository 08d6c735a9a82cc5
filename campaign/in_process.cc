#include "campaign/in_process.h"

#include <algorithm>

#include "base/error.h"
#include "base/worker_pool.h"
#include "campaign/part.h"

namespace unfurl::campaign {

CampaignRecord RunInProcess(const data::Campaign& plan, const JobOptions& options,
                            std::size_t workers) {
  if (plan.design.kind == data::CampaignDesign::Kind::kRare || !plan.design.until.empty()) {
    throw Error("hangs on earlier runs", plan.path + ":campaign.design",
                "RunRare and GrowUntil run such plans in a folder");
  }
  const Inputs inputs(plan);
  const std::vector<double> typical = inputs.Typical();
  MakeJob(plan, typical, options);  // names are looked at before threads begin
  // Some parts a worker, so that all end together; a job, which reads the scene, is made for each.
  constexpr std::uint64_t kPartsOfWorker = 8;
  const std::uint64_t parts =
      std::min<std::uint64_t>(inputs.runs(), kPartsOfWorker * WorkerCount(workers));
  std::vector<Part> done(parts);
  ParallelFor(parts, workers, [&](std::size_t i) {
    const std::unique_ptr<Job> job = MakeJob(plan, typical, options);
    done[i] = RunPart(inputs, job.get(), ShardRange(inputs.runs(), i + 1, parts));
  });
  CampaignRecord record;
  record.plan = plan;
  record.runs = inputs.runs();
  const std::size_t k = plan.responses.size();
  record.responses.resize(k);
  for (const Part& part : done) {
    for (std::size_t i = 0; i < part.responses.size(); ++i) {
      record.responses[i % k].push_back(part.responses[i]);
    }
    record.failed.insert(record.failed.end(), part.failed.begin(), part.failed.end());
    record.messages.insert(record.messages.end(), part.messages.begin(), part.messages.end());
  }
  return record;
}

}  // namespace unfurl::campaign
