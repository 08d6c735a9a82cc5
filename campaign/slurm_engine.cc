#include "campaign/slurm_engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "campaign/slurm.h"
#include "data/atomic_file.h"
#include "data/inputs.h"

namespace unfurl::campaign {

namespace {

using nlohmann::ordered_json;

constexpr char kState[] = "slurm.json";

std::vector<std::string> JobsOf(const SlurmJobs& jobs) {
  std::vector<std::string> out;
  for (const SlurmArray& array : jobs.arrays) out.push_back(array.job);
  return out;
}

std::set<std::uint64_t> Queued(const SlurmJobs& jobs) {
  std::map<std::string, std::uint64_t> offsets;
  for (const SlurmArray& array : jobs.arrays) offsets[array.job] = array.offset;
  std::set<std::uint64_t> out;
  for (const SlurmTask& task : SlurmQueue(JobsOf(jobs))) {
    const auto found = offsets.find(task.job);
    if (found != offsets.end()) out.insert(found->second + task.task);
  }
  return out;
}

}  // namespace

SlurmJobs ReadSlurmJobs(const CampaignFolder& folder) {
  const std::string path = folder.LogPath(kState);
  SlurmJobs jobs;
  if (!std::filesystem::exists(path)) return jobs;
  try {
    const ordered_json j = ordered_json::parse(data::ReadTextFile(path));
    data::ForgetInput(path);  // ours to replace
    jobs.shards = j.at("shards");
    for (const ordered_json& array : j.at("arrays")) {
      jobs.arrays.push_back({array.at("job"), array.at("offset")});
    }
  } catch (const nlohmann::json::exception&) {
    throw Error("does not say which jobs Slurm has", path, "remove it, and cancel them by hand");
  }
  return jobs;
}

void WriteSlurmJobs(const CampaignFolder& folder, const SlurmJobs& jobs) {
  ordered_json j = {{"shards", jobs.shards}, {"arrays", ordered_json::array()}};
  for (const SlurmArray& array : jobs.arrays) {
    j["arrays"].push_back({{"job", array.job}, {"offset", array.offset}});
  }
  data::WriteTextFile(folder.LogPath(kState), j.dump(1) + "\n");
}

std::vector<std::uint64_t> MissingShards(const CampaignFolder& folder, std::uint64_t runs,
                                         std::uint64_t shards) {
  std::vector<std::uint64_t> out;
  // Both are in order: one pass.
  std::uint64_t shard = 1;
  for (const RunRange& range : folder.Missing(runs)) {
    while (shard <= shards && ShardRange(runs, shard, shards).end() <= range.first) ++shard;
    while (shard <= shards && ShardRange(runs, shard, shards).first < range.end()) {
      out.push_back(shard++);
    }
  }
  return out;
}

std::string SlurmScript(const CampaignFolder& folder, std::uint64_t shards,
                        const EngineOptions& options) {
  std::string out =
      "#!/bin/bash\n# Written by `unfurl campaign`: one task of an array, one shard.\n";
  out += "shard=$((UNFURL_OFFSET + SLURM_ARRAY_TASK_ID))\n";
  out +=
      fmt::format("{} campaign {} --shard \"$shard/{}\" --quiet{}\n", ShellQuoted(options.program),
                  ShellQuoted(folder.path()), shards, options.allow_programs ? " --allow-programs" : "");
  // What was killed from outside is queued again by Slurm, three times at most.
  out +=
      "code=$?\n"
      "if [ \"$code\" -gt 128 ] && [ \"${SLURM_RESTART_COUNT:-0}\" -lt 3 ]; then\n"
      "  scontrol requeue \"${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}\"\n"
      "fi\n"
      "exit \"$code\"\n";
  return out;
}

std::uint64_t SubmitToSlurm(const CampaignFolder& folder, std::uint64_t runs,
                            const std::vector<std::string>& sbatch_options,
                            const EngineOptions& options, SlurmJobs* jobs) {
  const std::set<std::uint64_t> queued = Queued(*jobs);
  std::vector<std::uint64_t> wanted;
  for (const std::uint64_t shard : MissingShards(folder, runs, jobs->shards)) {
    if (queued.count(shard) == 0) wanted.push_back(shard);
  }
  if (wanted.empty()) return 0;
  const std::string script = folder.LogPath("task.sh");
  data::WriteTextFile(script, SlurmScript(folder, jobs->shards, options));
  const std::uint64_t most = MaxArraySize() - 1;
  for (std::size_t i = 0; i < wanted.size();) {
    const std::uint64_t offset = (wanted[i] - 1) / most * most;
    std::vector<std::uint64_t> tasks;
    while (i < wanted.size() && wanted[i] <= offset + most) tasks.push_back(wanted[i++] - offset);
    const std::string id =
        SubmitArray({"unfurl-campaign", script, ArrayText(tasks), folder.LogPath("%A_%a.log"),
                     fmt::format("UNFURL_OFFSET={}", offset), sbatch_options});
    jobs->arrays.push_back({id, offset});
    // Known at once: a program that is killed here must not hand them over again.
    WriteSlurmJobs(folder, *jobs);
  }
  return wanted.size();
}

std::map<std::string, std::uint64_t> SlurmStates(const SlurmJobs& jobs) {
  std::map<std::string, std::uint64_t> out;
  for (const SlurmTask& task : SlurmQueue(JobsOf(jobs))) ++out[task.state];
  return out;
}

void CancelSlurm(const SlurmJobs& jobs) { CancelJobs(JobsOf(jobs)); }

}  // namespace unfurl::campaign
