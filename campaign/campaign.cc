#include "campaign/campaign.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "base/error.h"

namespace unfurl::campaign {

namespace {

// Every file that the runs of a plan depend on, beside the plan itself.
std::vector<std::string> FilesOf(const data::Campaign& plan, const Job& job) {
  std::vector<std::string> files = plan.inputs;
  for (const std::string& file : job.inputs()) {
    if (std::find(files.begin(), files.end(), file) == files.end()) files.push_back(file);
  }
  return files;
}

}  // namespace

std::vector<double> OpenCampaign::Values(std::size_t response) const {
  const std::size_t k = inputs.plan().responses.size();
  std::vector<double> out(inputs.runs(), std::numeric_limits<double>::quiet_NaN());
  for (const PartFile& file : folder.Parts()) {
    const Part part = ReadPart(file.path, folder.identity(), k);
    for (std::uint64_t i = 0; i < part.range.count && part.range.first + i < out.size(); ++i) {
      out[part.range.first + i] = part.responses[i * k + response];
    }
  }
  return out;
}

void OpenCampaign::Extend(std::uint64_t runs) {
  inputs = inputs.WithRuns(runs);
  folder.WritePlan(inputs.plan());
}

OpenCampaign OpenPlan(const data::Campaign& plan, const std::string& folder,
                      const JobOptions& options) {
  Inputs inputs(plan);
  std::unique_ptr<Job> job = MakeJob(plan, inputs.Typical(), options);
  std::vector<std::string> files = FilesOf(plan, *job);
  CampaignFolder made = CampaignFolder::Make(folder, plan, IdentityOf(plan, files));
  return {std::move(inputs), std::move(made), std::move(files), std::move(job)};
}

OpenCampaign OpenFolder(const std::string& folder, const JobOptions& options) {
  CampaignFolder opened = CampaignFolder::Open(folder);
  Inputs inputs(opened.ReadPlan());
  std::unique_ptr<Job> job = MakeJob(inputs.plan(), inputs.Typical(), options);
  std::vector<std::string> files = FilesOf(inputs.plan(), *job);
  if (IdentityOf(inputs.plan(), files) != opened.identity()) {
    throw Error("a file that its runs depend on, or this program, has changed since", folder,
                "begin anew in another folder (--folder), or put the file back");
  }
  return {std::move(inputs), std::move(opened), std::move(files), std::move(job)};
}

void ComputePart(const OpenCampaign& campaign, const RunRange& range,
                 const std::function<void(std::uint64_t)>& progress) {
  const std::size_t k = campaign.inputs.plan().responses.size();
  const std::string path = campaign.folder.PartPath(range);
  if (std::filesystem::exists(path)) {
    try {
      ReadPart(path, campaign.folder.identity(), k);
      return;
    } catch (const Error&) {
      // Damaged: made again in its place.
    }
  }
  const Part part = RunPart(campaign.inputs, campaign.job.get(), range, progress);
  WritePart(path, part, campaign.folder.identity(), k);
}

}  // namespace unfurl::campaign
