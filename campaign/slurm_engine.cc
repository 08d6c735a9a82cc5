#include "campaign/slurm_engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/inputs.h"
#include "data/scratch_folder.h"

namespace unfurl::campaign {

namespace {

using nlohmann::ordered_json;

constexpr char kState[] = "slurm.json";
constexpr double kPatience = 60.0;                 // for an answer of the controller [s]
constexpr std::uint64_t kDefaultArraySize = 1001;  // Slurm's own default of MaxArraySize

struct Answer {
  int code = 0;
  std::string out, err;
};

// A program of Slurm.
Answer Ask(const std::vector<std::string>& words) {
  const data::ScratchFolder scratch("unfurl-slurm-");
  const std::string out = scratch.File("out"), err = scratch.File("err");
  const ProgramOutcome outcome =
      RunProgram(words, std::filesystem::current_path().string(), out, err, kPatience);
  if (!outcome.started) {
    throw Error("there is no '" + words.front() + "' here", "--engine slurm",
                "run it where Slurm is, or take --engine local");
  }
  if (outcome.timed_out) {
    throw Error(fmt::format("'{}' does not answer", words.front()), "--engine slurm",
                "try again when the controller is up", ErrorKind::kMachine);
  }
  return {outcome.code, data::ReadTextFile(out), data::LastLineOf(err)};
}

bool ParseWhole(std::string_view text, std::uint64_t* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

// Indices of an array's tasks are below this.
std::uint64_t MaxArraySize() {
  const Answer answer = Ask({"scontrol", "show", "config"});
  for (const std::string& line : Split(answer.out, '\n')) {
    const std::size_t equals = line.find('=');
    std::uint64_t value = 0;
    if (equals != std::string::npos &&
        Trim(std::string_view(line).substr(0, equals)) == "MaxArraySize" &&
        ParseWhole(Trim(std::string_view(line).substr(equals + 1)), &value) && value > 1) {
      return value;
    }
  }
  return kDefaultArraySize;
}

// "state job task", a line each; nothing for jobs that Slurm has forgotten.
std::vector<std::vector<std::string>> QueueLines(const SlurmJobs& jobs) {
  std::vector<std::vector<std::string>> out;
  for (const SlurmArray& array : jobs.arrays) {
    const Answer answer = Ask({"squeue", "-h", "-r", "-j", array.job, "-o", "%T %F %K"});
    // Of a job that has ended some versions say so as an error.
    if (answer.code != 0 && answer.err.find("Invalid job id") == std::string::npos) {
      throw Error("squeue refuses: " + answer.err, "--engine slurm", "try again",
                  ErrorKind::kMachine);
    }
    for (const std::string& line : Split(answer.out, '\n')) {
      std::vector<std::string> words = Split(std::string(Trim(line)), ' ');
      if (words.size() == 3) out.push_back(std::move(words));
    }
  }
  return out;
}

std::set<std::uint64_t> Queued(const SlurmJobs& jobs) {
  std::map<std::string, std::uint64_t> offsets;
  for (const SlurmArray& array : jobs.arrays) offsets[array.job] = array.offset;
  std::set<std::uint64_t> out;
  if (jobs.arrays.empty()) return out;
  for (const std::vector<std::string>& words : QueueLines(jobs)) {
    std::uint64_t task = 0;
    const auto found = offsets.find(words[1]);
    if (found != offsets.end() && ParseWhole(words[2], &task)) out.insert(found->second + task);
  }
  return out;
}

std::string Quoted(const std::string& text) {
  std::string copy = text;
  data::ReplaceAll(&copy, "'", "'\\''");
  return "'" + copy + "'";
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

std::string ArrayText(const std::vector<std::uint64_t>& tasks) {
  std::string out;
  for (std::size_t i = 0; i < tasks.size();) {
    std::size_t last = i;
    while (last + 1 < tasks.size() && tasks[last + 1] == tasks[last] + 1) ++last;
    if (!out.empty()) out += ",";
    out += last == i ? fmt::format("{}", tasks[i]) : fmt::format("{}-{}", tasks[i], tasks[last]);
    i = last + 1;
  }
  return out;
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
      fmt::format("{} campaign {} --shard \"$shard/{}\" --quiet{}\n", Quoted(options.program),
                  Quoted(folder.path()), shards, options.allow_programs ? " --allow-programs" : "");
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
    std::vector<std::string> words = {
        "sbatch",
        "--parsable",
        "--requeue",
        "--job-name=unfurl-campaign",
        "--array=" + ArrayText(tasks),
        "--output=" + std::filesystem::absolute(folder.LogPath("%A_%a.log")).string(),
        "--chdir=" + std::filesystem::current_path().string(),
        fmt::format("--export=ALL,UNFURL_OFFSET={}", offset)};
    words.insert(words.end(), sbatch_options.begin(), sbatch_options.end());
    words.push_back(script);
    const Answer answer = Ask(words);
    const std::string id = Split(std::string(Trim(answer.out)), ';').front();
    if (answer.code != 0 || id.empty()) {
      throw Error("sbatch refuses: " + answer.err, "--engine slurm",
                  "look at [slurm] options of the plan", ErrorKind::kMachine);
    }
    jobs->arrays.push_back({id, offset});
    // Known at once: a program that is killed here must not hand them over again.
    WriteSlurmJobs(folder, *jobs);
  }
  return wanted.size();
}

std::map<std::string, std::uint64_t> SlurmStates(const SlurmJobs& jobs) {
  std::map<std::string, std::uint64_t> out;
  if (jobs.arrays.empty()) return out;
  for (const std::vector<std::string>& words : QueueLines(jobs)) ++out[words[0]];
  return out;
}

void CancelSlurm(const SlurmJobs& jobs) {
  if (jobs.arrays.empty()) return;
  std::vector<std::string> words = {"scancel"};
  for (const SlurmArray& array : jobs.arrays) words.push_back(array.job);
  const Answer answer = Ask(words);
  if (answer.code != 0 && answer.err.find("Invalid job id") == std::string::npos) {
    throw Error("scancel refuses: " + answer.err, "--engine slurm", "try again",
                ErrorKind::kMachine);
  }
}

}  // namespace unfurl::campaign
