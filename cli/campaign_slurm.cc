#include "cli/campaign_slurm.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "campaign/growth.h"

namespace unfurl::cli {

namespace {

using campaign::EngineOptions;
using campaign::OpenCampaign;
using nlohmann::ordered_json;

constexpr int kSlurmRounds = 3;        // times that missing shards are handed over again
constexpr double kPilotSeconds = 5.0;  // of runs here, by which tasks are sized [s]
constexpr std::uint64_t kPilotRuns = 4, kPilotPart = 50;  // at least; of a large campaign a 50th
constexpr std::chrono::seconds kPoll{2};                  // between looks at the queue

// Into how many shards a campaign is cut so that each takes so many seconds.
std::uint64_t ShardsByPilot(const OpenCampaign& c, const EngineOptions& options, double seconds) {
  const std::uint64_t runs = c.inputs.runs();
  EngineOptions pilot = options;
  pilot.budget = kPilotSeconds;
  pilot.most = std::max<std::uint64_t>(kPilotRuns, runs / kPilotPart);
  const campaign::EngineReport report = campaign::RunLocally(c.folder, runs, pilot);
  const double mean =
      report.runs == 0 ? 0.0 : report.run_seconds / static_cast<double>(report.runs);
  const double shards = std::ceil(static_cast<double>(runs) * mean / seconds);
  return static_cast<std::uint64_t>(std::clamp(shards, 1.0, static_cast<double>(runs)));
}

}  // namespace

std::string CampaignNote(std::uint64_t done, std::uint64_t runs) {
  return fmt::format("{} of {} runs", done, runs);
}

ordered_json CampaignStatus(const OpenCampaign& c, const campaign::SlurmJobs& jobs) {
  const std::uint64_t missing = c.folder.MissingRuns(c.inputs.runs());
  ordered_json out = {{"folder", c.folder.path()},
                      {"runs", c.inputs.runs()},
                      {"done", c.inputs.runs() - missing},
                      {"parts", c.folder.Parts().size()}};
  if (jobs.shards > 0) {
    out["shards"] = jobs.shards;
    out["shards_missing"] = campaign::MissingShards(c.folder, c.inputs.runs(), jobs.shards).size();
    out["queue"] = campaign::SlurmStates(jobs);
  }
  return out;
}

std::string CampaignStatusText(const ordered_json& s) {
  std::string out = fmt::format("{}: {} of {} runs are done\n", s["folder"].get<std::string>(),
                                s["done"].get<std::uint64_t>(), s["runs"].get<std::uint64_t>());
  if (!s.contains("shards")) return out;
  out += fmt::format("Slurm: {} of {} shards missing; in its queue", s["shards_missing"].get<int>(),
                     s["shards"].get<int>());
  std::vector<std::string> states;
  for (const auto& [state, count] : s["queue"].items()) {
    states.push_back(fmt::format("{} {}", count.get<int>(), state));
  }
  return out + (states.empty() ? ": nothing\n" : ": " + JoinWords(states) + "\n");
}

std::uint64_t HandToSlurm(const OpenCampaign& c, const EngineOptions& options, double seconds,
                          campaign::SlurmJobs* jobs) {
  if (jobs->shards == 0) jobs->shards = ShardsByPilot(c, options, seconds);
  const std::uint64_t handed = campaign::SubmitToSlurm(c.folder, c.inputs.runs(),
                                                       c.inputs.plan().slurm, options, jobs);
  campaign::WriteSlurmJobs(c.folder, *jobs);
  return handed;
}

void GrowBySlurm(OpenCampaign* c, const EngineOptions& options, double seconds,
                 campaign::SlurmJobs* jobs, Progress* progress) {
  bool first = true;  // of an earlier program's arrays, some may still run
  campaign::GrowUntil(c, [&](const OpenCampaign& now) {
    if (!first) *jobs = {};  // the new runs are cut anew
    first = false;
    HandToSlurm(now, options, seconds, jobs);
    WaitForSlurm(now, options, jobs, progress);
    return campaign::EngineReport{};
  });
}

// Until all shards are whole; hands missing ones over again when the queue has run dry.
void WaitForSlurm(const OpenCampaign& c, const EngineOptions& options, campaign::SlurmJobs* jobs,
                  Progress* progress) {
  const std::uint64_t runs = c.inputs.runs();
  for (int round = 0;;) {
    const std::uint64_t missing = c.folder.MissingRuns(runs);
    if (missing == 0) return;
    progress->Update(static_cast<double>(runs - missing) / static_cast<double>(runs),
                     CampaignNote(runs - missing, runs));
    if (campaign::SlurmStates(*jobs).empty()) {
      // A part is renamed by another machine: its name may come late.
      std::this_thread::sleep_for(kPoll);
      if (c.folder.Missing(runs).empty()) return;
      if (++round > kSlurmRounds) {
        throw Error(fmt::format("{} runs are still missing after {} rounds", missing, kSlurmRounds),
                    c.folder.path(), "look at " + c.folder.LogPath("") + ", and resume",
                    ErrorKind::kMachine);
      }
      campaign::SubmitToSlurm(c.folder, runs, c.inputs.plan().slurm, options, jobs);
    }
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace unfurl::cli
