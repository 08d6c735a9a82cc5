// `unfurl campaign --engine slurm` on a small cluster of this machine.
#include "tests/cli/campaign_slurm.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace unfurl::cli::campaign_slurm_test {
namespace {

using nlohmann::json;

TEST_F(CampaignSlurm, GivesTheBitsOfThisMachine) {
  Start(3, 2);
  Put("block.toml",
      "[scene]\nname = 'block'\nduration = 2.0\n[body.block]\nmass = 2.0\ninertia = 0.1\n"
      "velocity = [0.7, 0, 0]\n");
  Put("plan.toml",
      "[campaign]\nruns = 16\n[job]\nscene = 'block.toml'\nrate = 50\n[variable.v]\n"
      "keys = ['body.block.velocity[0]']\nuniform = [0.25, 1.0]\n[response.x]\n"
      "quantity = 'block.x'\nof = 'final'\n[slurm]\noptions = ['--time=00:10:00']\n");
  ASSERT_EQ(Run({"campaign", "plan.toml", "-o", "local.h5", "--quiet"}).code, 0);
  // Parts of nothing: a task for each run that the pilot has left.
  const Outcome handed =
      Run({"campaign", "plan.toml", "--engine", "slurm", "--part", "1e-9", "--json"});
  ASSERT_EQ(handed.code, 0) << handed.err;
  const json status = json::parse(handed.out);
  EXPECT_EQ(status.at("shards"), 16);
  EXPECT_GT(status.at("handed_over"), 8);
  // What the queue has is not handed over again; then all of it is waited for and merged.
  const Outcome whole =
      Run({"campaign", "resume", "plan.toml", "--wait", "-o", "slurm.h5", "--quiet"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_TRUE(Get("slurm.h5") == Get("local.h5"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plan.runs"));
}

TEST_F(CampaignSlurm, RunsAreAddedUntilAnAnswerIsSharp) {
  if (IsSkipped()) return;
  Start(2, 2);
  Put("block.toml",
      "[scene]\nname = 'block'\nduration = 2.0\n[body.block]\nmass = 2.0\ninertia = 0.1\n"
      "velocity = [0.7, 0, 0]\n");
  Put("plan.toml",
      "[campaign]\ndesign = 'random'\nruns = 20\nuntil = 'mean(x) +- 0.1'\n[job]\n"
      "scene = 'block.toml'\nrate = 50\n[variable.v]\nkeys = ['body.block.velocity[0]']\n"
      "uniform = [0.25, 1.0]\n[response.x]\nquantity = 'block.x'\nof = 'final'\n");
  ExpectRefused(Run({"campaign", "plan.toml", "--engine", "slurm"}),
                {"campaign.until", "--wait"}, Files());
  ASSERT_EQ(Run({"campaign", "plan.toml", "-o", "local.h5", "--quiet"}).code, 0);
  const Outcome grown = Run({"campaign", "plan.toml", "--engine", "slurm", "--part", "0.02",
                             "--wait", "-o", "slurm.h5", "--json"});
  ASSERT_EQ(grown.code, 0) << grown.err;
  // sigma 0.433 of the block's way: 72 runs for a half-width of 0.1, more than there were.
  EXPECT_GT(json::parse(grown.out).at("runs"), 40);
  EXPECT_TRUE(Get("slurm.h5") == Get("local.h5"));
}

TEST_F(CampaignSlurm, WhatIsCancelledCanBeResumed) {
  Start(1, 1);
  Put("plan.toml",
      "[campaign]\nruns = 8\n[job]\n[[job.step]]\nrun = ['sh', '-c', '''sleep 0.2; echo "
      "\"{\\\"x\\\": {v}}\"''']\n[variable.v]\nuniform = [1, 2]\n[response.x]\npointer = '/x'\n");
  const std::vector<std::string> begin = {
      "campaign", "plan.toml", "--allow-programs", "--engine", "slurm", "--part", "1e-9", "--json"};
  ASSERT_EQ(Run(begin).code, 0);
  const Outcome cancelled = Run({"campaign", "cancel", "plan.runs", "--allow-programs", "--json"});
  ASSERT_EQ(cancelled.code, 0) << cancelled.err;
  EXPECT_LT(json::parse(cancelled.out).at("done"), 8);
  const Outcome whole = Run({"campaign", "resume", "plan.toml", "--allow-programs", "--wait", "-o",
                             "slurm.h5", "--quiet"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  const Outcome local =
      Run({"campaign", "plan.toml", "--allow-programs", "-o", "local.h5", "--quiet"});
  ASSERT_EQ(local.code, 0) << local.err;
  EXPECT_TRUE(Get("slurm.h5") == Get("local.h5"));
}

}  // namespace
}  // namespace unfurl::cli::campaign_slurm_test
