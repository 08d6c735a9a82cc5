// A campaign on 64 virtual nodes: with workers, a node and the controller killed under it; and a
// million runs (UNFURL_CAMPAIGN_RUNS for another number).
#include <gmock/gmock.h>
#include <signal.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/cli/campaign_slurm.h"

namespace unfurl::cli::campaign_slurm_slow_test {
namespace {

using nlohmann::json;
using namespace std::chrono_literals;

class CampaignSlurmSlow : public CampaignSlurm {
 protected:
  void PutBlock(long runs) const {
    Put("block.toml",
        "[scene]\nname = 'block'\nduration = 2.0\n[body.block]\nmass = 2.0\ninertia = 0.1\n"
        "velocity = [0.7, 0, 0]\n[event.passes]\nwhen = 'block.x'\nlevel = 1.0\n");
    Put("plan.toml", "[campaign]\ndesign = 'random'\nruns = " + std::to_string(runs) +
                         "\n[job]\nscene = 'block.toml'\nrate = 50\n[variable.v]\n"
                         "keys = ['body.block.velocity[0]']\nuniform = [0.25, 1.0]\n[response.x]\n"
                         "quantity = 'block.x'\nof = 'final'\n[response.passed]\n"
                         "event = 'watch'\n");
  }
  // Of those workers that run now, at random; returns how many.
  static int KillSome(int most) {
    const std::string command =
        "pgrep -f 'campaign plan.runs --shard' | shuf -n " + std::to_string(most);
    std::FILE* found = popen(command.c_str(), "r");
    int killed = 0, pid = 0;
    while (found != nullptr && std::fscanf(found, "%d", &pid) == 1) {
      killed += kill(pid, SIGKILL) == 0 ? 1 : 0;
    }
    if (found != nullptr) pclose(found);
    return killed;
  }
  static double Seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
};

TEST_F(CampaignSlurmSlow, KillsOfWorkersANodeAndTheControllerChangeNothing) {
  if (IsSkipped()) return;
  constexpr long kRuns = 60000;  // a minute of two cores: long enough to be killed fifty times
  Start(64, 1);
  PutBlock(kRuns);
  ASSERT_EQ(Run({"campaign", "plan.toml", "-o", "local.h5", "--quiet"}).code, 0);
  const Outcome handed =
      Run({"campaign", "plan.toml", "--engine", "slurm", "--part", "0.1", "--json"});
  ASSERT_EQ(handed.code, 0) << handed.err;
  int killed = 0;
  for (int round = 0; round < 2000 && killed < 50; ++round) {
    killed += KillSome(2);
    if (round == 50) {
      EXPECT_TRUE(Toy("kill-node", "3"));
    }
    if (round == 100) {
      EXPECT_TRUE(Toy("kill-controller"));
      std::this_thread::sleep_for(500ms);
      EXPECT_TRUE(Toy("start-controller"));
    }
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(Toy("start-node", "3"));
  Outcome whole;
  // A controller that has just come up does not answer at once.
  for (int round = 0; round < 5; ++round) {
    whole = Run({"campaign", "resume", "plan.toml", "--engine", "slurm", "--wait", "-o", "slurm.h5",
                 "--quiet"});
    if (whole.code == 0) break;
    std::this_thread::sleep_for(2s);
  }
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_TRUE(Get("slurm.h5") == Get("local.h5"));
  std::printf("found: %s shards of %ld runs, %d workers killed, a node, the controller\n",
              json::parse(handed.out).at("shards").dump().c_str(), kRuns, killed);
}

// The folder lies on a disk of its own, which fills while shards are being computed.
TEST_F(CampaignSlurmSlow, AFullDiskLosesNothing) {
  if (IsSkipped()) return;
  const std::string disk = (folder_ / "disk").string();
  std::filesystem::create_directory(disk);
  if (std::system(("mount -t tmpfs -o size=16m tmpfs '" + disk + "' 2>&1").c_str()) != 0) {
    GTEST_SKIP() << "no disk can be mounted here";
  }
  Start(4, 2);
  PutBlock(30000);
  ASSERT_EQ(Run({"campaign", "plan.toml", "-o", "local.h5", "--quiet"}).code, 0);
  std::vector<std::string> words = {"campaign", "plan.toml", "--engine", "slurm", "--folder",
                                    "disk/runs", "--part",   "0.2",      "--json"};
  const Outcome handed = Run(words);
  EXPECT_EQ(handed.code, 0) << handed.err;
  std::system(("dd if=/dev/zero of='" + disk + "/filler' bs=4k 2>/dev/null").c_str());
  // Until Slurm has tried them all.
  json status;
  for (int round = 0; round < 300; ++round) {
    const Outcome outcome = Run({"campaign", "status", "disk/runs", "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    status = json::parse(outcome.out);
    if (status.at("queue").empty()) break;
    std::this_thread::sleep_for(1s);
  }
  EXPECT_GT(status.at("shards_missing"), 0);
  std::filesystem::remove(disk + "/filler");
  words.pop_back();
  words.insert(words.end(), {"--wait", "--keep", "-o", "slurm.h5", "--quiet"});
  const Outcome whole = Run(words);
  std::system(("umount -l '" + disk + "'").c_str());
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_TRUE(Get("slurm.h5") == Get("local.h5"));
  std::printf("found: %d of %d shards found the disk full\n",
              status.at("shards_missing").get<int>(), status.at("shards").get<int>());
}

TEST_F(CampaignSlurmSlow, AMillionRuns) {
  if (IsSkipped()) return;
  const char* given = std::getenv("UNFURL_CAMPAIGN_RUNS");
  const long runs = given == nullptr ? 1'000'000 : std::atol(given);
  Start(64, 1);
  PutBlock(runs);
  const double start = Seconds();
  ASSERT_EQ(Run({"campaign", "plan.toml", "--engine", "slurm", "--part", "5", "--json"}).code, 0);
  long done = 0;
  while (done < runs && Seconds() - start < 3600.0) {
    std::this_thread::sleep_for(5s);
    const Outcome status = Run({"campaign", "status", "plan.runs", "--json"});
    if (status.code == 0) done = json::parse(status.out).at("done");
  }
  const double computed = Seconds();
  const Outcome merged = Run({"campaign", "merge", "plan.runs", "-o", "runs.h5", "--json"});
  ASSERT_EQ(merged.code, 0) << merged.err;
  const json answers = json::parse(merged.out);
  EXPECT_EQ(answers.at("runs"), runs);
  const json& interval = answers.at("responses").at("passed").at("probability").at("interval");
  EXPECT_LE(interval[0].get<double>(), 2.0 / 3.0);
  EXPECT_GE(interval[1].get<double>(), 2.0 / 3.0);
  std::printf("found: %ld runs in %.0f s, merged and answered in %.1f s with %ld MB\n", runs,
              computed - start, Seconds() - computed, merged.peak_kb / 1024);
}

}  // namespace
}  // namespace unfurl::cli::campaign_slurm_slow_test
