// `unfurl campaign` through the real program: engines, shards, kills, answers.
#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tests/cli/program.h"
#include "tests/source_dir.h"

namespace unfurl::cli::campaign_verb_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class CampaignVerb : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    // It is at v t, and passes 1 m at 1 / v.
    Put("block.toml",
        "[scene]\nname = 'block'\nduration = 2.0\n[body.block]\nmass = 2.0\ninertia = 0.1\n"
        "velocity = [0.7, 0, 0]\n[event.passes]\nwhen = 'block.x'\nlevel = 1.0\n");
    PutPlan("runs = 60\n");
  }
  void PutPlan(const std::string& campaign) const {
    Put("plan.toml", "[campaign]\n" + campaign +
                         "[job]\nscene = 'block.toml'\nrate = 50\n[variable.v]\n"
                         "keys = ['body.block.velocity[0]']\nuniform = [0.25, 1.0]\n"
                         "[response.x]\nquantity = 'block.x'\nof = 'final'\n"
                         "[response.passed]\nevent = 'watch'\n"
                         "[response.margin]\nexpression = 'x - 0.6'\n");
  }
  std::string Good(std::vector<std::string> words) const {
    words.insert(words.begin(), "campaign");
    const Outcome outcome = Run(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.out;
  }
};

TEST_F(CampaignVerb, WorkersShardsAndResumingGiveTheSameBits) {
  Good({"plan.toml", "--workers", "1", "-o", "one.h5", "--quiet"});
  const std::string one = Get("one.h5");
  ASSERT_FALSE(one.empty());
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plan.runs"));
  Good({"plan.toml", "--workers", "3", "-o", "three.h5", "--quiet"});
  EXPECT_TRUE(Get("three.h5") == one);
  // By hand, as any scheduler would, the last shard first and one of them left to `resume`.
  for (const char* shard : {"7/7", "3/7", "1/7", "2/7", "6/7", "4/7"}) {
    Good({"plan.toml", "--shard", shard, "--quiet"});
  }
  const json status = json::parse(Good({"status", "plan.toml", "--json"}));
  EXPECT_EQ(status.at("runs"), 60);
  EXPECT_EQ(status.at("done"), 52);  // the first four shards have nine runs, the others eight
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"campaign", "merge", "plan.toml", "-o", "early.h5"}),
                {"8 of 60 runs are missing", "resume"}, before);
  Good({"resume", "plan.toml", "-o", "shards.h5", "--quiet", "--keep"});
  EXPECT_TRUE(Get("shards.h5") == one);
  Good({"merge", "plan.runs", "-o", "merged.h5", "--quiet"});
  EXPECT_TRUE(Get("merged.h5") == one);
}

TEST_F(CampaignVerb, AnswersComeWithoutNewRuns) {
  const json first = json::parse(Good({"plan.toml", "-o", "runs.h5", "--json"}));
  json again = json::parse(Good({"answers", "runs.h5", "--json", "--report", "page.html"}));
  EXPECT_EQ(again.at("responses"), first.at("responses"));
  const json& passed = again.at("responses").at("passed").at("probability");
  EXPECT_LE(passed.at("interval")[0].get<double>(), 2.0 / 3.0);
  EXPECT_GE(passed.at("interval")[1].get<double>(), 2.0 / 3.0);
  EXPECT_THAT(Get("page.html"), HasSubstr("P(passed)"));
  EXPECT_THAT(Get("page.html"), HasSubstr("Distribution of x"));
}

TEST_F(CampaignVerb, RunsAreAddedUntilTheAnswerIsAsSharp) {
  PutPlan("design = 'random'\nruns = 50\n");
  const json sharp =
      json::parse(Good({"plan.toml", "--until", "P(passed) +- 0.05", "-o", "runs.h5", "--json"}));
  const json& interval = sharp.at("responses").at("passed").at("probability").at("interval");
  EXPECT_LE(0.5 * (interval[1].get<double>() - interval[0].get<double>()), 0.05);
  EXPECT_GT(sharp.at("runs"), 300);  // 1.96^2 p q / 0.05^2 = 341
  EXPECT_LT(sharp.at("runs"), 1500);
}

// v is normal and fails below 0.5: P = Phi(-4) = 3.17e-5.
TEST_F(CampaignVerb, RareFailuresAreFound) {
  PutPlan("design = 'rare'\nfailure = 'left'\nruns = 2000\n");
  Put("plan.toml", Get("plan.toml") + "[response.left]\nexpression = 'v - 0.5'\n");
  std::string text = Get("plan.toml");
  text.replace(text.find("uniform = [0.25, 1.0]"), 21, "normal = [0.7, 0.05]");
  Put("plan.toml", text);
  const json rare = json::parse(Good({"plan.toml", "-o", "rare.h5", "--json"}));
  const double p = 3.167e-5;
  EXPECT_GT(rare.at("probability"), p / 1.5);
  EXPECT_LT(rare.at("probability"), p * 1.5);
  EXPECT_LE(rare.at("interval")[0], p);
  EXPECT_GE(rare.at("interval")[1], p);
  EXPECT_LE(rare.at("runs"), 2000);
  const json again = json::parse(Good({"answers", "rare.h5", "--json", "--report", "page.html"}));
  EXPECT_EQ(again.at("probability"), rare.at("probability"));
  EXPECT_THAT(Get("page.html"), HasSubstr("Levels"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plan.runs"));
}

TEST_F(CampaignVerb, KilledAtAnyMomentItGoesOn) {
  Good({"plan.toml", "-o", "fresh.h5", "--quiet"});
  for (int after = 20; after < 400; after += 90) {
    RunProgram({"campaign", "plan.toml", "-o", "killed.h5", "--quiet"}, folder_, 0, after, SIGKILL);
  }
  Good({"plan.toml", "-o", "killed.h5", "--quiet"});
  EXPECT_TRUE(Get("killed.h5") == Get("fresh.h5"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "plan.runs"));
}

// A run that ends the program which computes it, found among the others.
TEST_F(CampaignVerb, ARunThatCrashesIsAFailedRunAndNoOther) {
  Put("steps.toml",
      "[campaign]\nruns = 12\n[job]\n[[job.step]]\nrun = ['sh', '-c', '''[ {run} != "
      "5 ] || kill -ILL $PPID; echo \"{\\\"x\\\": {v}}\"''']\n[variable.v]\n"
      "uniform = [1, 2]\n[response.v_again]\npointer = '/x'\n");
  const json all = json::parse(Good({"steps.toml", "--allow-programs", "-o", "runs.h5", "--json"}));
  EXPECT_EQ(all.at("failed"), 1);
  EXPECT_THAT(all.at("failures")[0].at("message"), HasSubstr("ends the program"));
  EXPECT_EQ(all.at("responses").at("v_again").at("present"), 11);
}

TEST_F(CampaignVerb, StepsRunThisProgram) {
  Put("steps.toml",
      "[campaign]\nruns = 3\n[job]\nfiles = ['block.toml']\n[[job.step]]\n"
      "run = ['unfurl', 'simulate', 'block.toml', '--set', 'scene.duration={d}', '-o', 'r.h5']\n"
      "[variable.d]\nuniform = [0.5, 1]\n[response.end]\npointer = '/t_end'\n"
      "[response.off]\nexpression = 'end - d'\n");
  const json all = json::parse(Good({"steps.toml", "-o", "runs.h5", "--json"}));
  EXPECT_EQ(all.at("failed"), 0) << all.at("failures");
  EXPECT_NEAR(all.at("responses").at("off").at("maximum"), 0.0, 1e-9);
}

TEST_F(CampaignVerb, WhatIsWrongIsSaidInOneLine) {
  const std::vector<std::string> before = Files();
  const auto refused = [&](std::vector<std::string> words, const std::vector<std::string>& says) {
    words.insert(words.begin(), "campaign");
    ExpectRefused(Run(words), says, before);
  };
  refused({"plan.toml", "--rows", "5:3"}, {"--rows", "5:3"});
  refused({"plan.toml", "--engine", "slurm", "--part", "-5"}, {"--part", "above 0"});
  refused({"plan.toml", "--shard", "1/2", "--rows", "0:3"}, {"--rows"});
  refused({"status", "plan.toml"}, {"plan.runs", "is not there"});
  refused({"resume", "plan.toml"}, {"plan.runs", "is not there"});
  refused({"plan.toml", "--set", "response.x.quantity=blok.x"}, {"response.x.quantity", "block.x"});
  refused({"plan.toml", "--until", "P(passed) +- 0.01"}, {"campaign.until", "random"});
  refused({"answers", "plan.toml"}, {"plan.toml"});
  refused({"plan.toml", "-o", "block.toml"}, {"block.toml"});
  Good({"plan.toml", "--rows", "0:3", "--quiet"});
  const std::vector<std::string> with_folder = Files();
  ExpectRefused(Run({"campaign", "plan.toml", "--shard", "0/4"}), {"--shard", "1/64"}, with_folder);
  ExpectRefused(Run({"campaign", "plan.toml", "--shard", "1/61"}), {"--shard"}, with_folder);
  ExpectRefused(Run({"campaign", "plan.runs", "--runs", "7"}), {"--runs"}, with_folder);
  ExpectRefused(Run({"campaign", "plan.toml", "--runs", "7"}), {"another plan", "--folder"},
                with_folder);
}

}  // namespace
}  // namespace unfurl::cli::campaign_verb_test
