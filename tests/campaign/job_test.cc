// What a run gives, against closed forms.
#include "campaign/job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "campaign/named_expression.h"
#include "tests/campaign/block.h"

namespace unfurl::campaign::job_test {
namespace {

using ::testing::HasSubstr;

constexpr double kClose = 1e-9;  // of a motion that any method integrates without error

std::string Refused(const data::Campaign& plan, const JobOptions& options = {}) {
  try {
    const std::vector<double> typical(plan.variables.size(), 0.5);
    MakeJob(plan, typical, options);
  } catch (const Error& e) {
    return e.what();
  }
  return "taken";
}

TEST(NamedExpression, KnowsItsNamesAndNoOthers) {
  const NamedExpression e("a > 2 && b < 1 ? a : -b", {"a", "b", "c"}, "here");
  EXPECT_EQ(e.Value(std::vector<double>{3.0, 0.0, 9.0}), 3.0);
  EXPECT_EQ(e.Value(std::vector<double>{1.0, 4.0, 9.0}), -4.0);
  EXPECT_EQ(e.used(), (std::vector<std::size_t>{0, 1}));
  EXPECT_TRUE(std::isnan(NamedExpression("log(a)", {"a"}, "here").Value(std::vector{-1.0})));
  EXPECT_TRUE(std::isnan(NamedExpression("1 / a", {"a"}, "here").Value(std::vector{0.0})));
  for (const char* wrong : {"a +", "peek", "a, b", "", "a = 2", "\"a\""}) {
    EXPECT_THROW(NamedExpression(wrong, {"a", "b", "peak"}, "here"), Error) << wrong;
  }
}

TEST(SceneJob, QuantitiesAndEventsAreThoseOfTheMotion) {
  const OwnFolder folder;
  const data::Campaign plan =
      BlockPlan(folder,
                "[response.last]\nquantity = \"block.x\"\nof = \"final\"\n"
                "[response.at]\nquantity = \"block.x\"\nof = \"at\"\nat = 0.503\n"
                "[response.mean]\nquantity = \"block.x\"\nof = \"mean\"\n"
                "[response.rms]\nquantity = \"block.x\"\nof = \"rms\"\n"
                "[response.range]\nquantity = \"block.x\"\nof = \"range\"\nfrom = 1.0\nto = 1.5\n"
                "[response.smallest]\nquantity = \"block.x\"\nof = \"smallest\"\nfrom = 0.5\n"
                "[response.passed]\nevent = \"watch\"\nwhere = \"passes\"\n"
                "[response.when]\nevent = \"watch\"\nof = \"time\"\n"
                "[response.often]\nevent = \"watch\"\nof = \"number\"\n"
                "[response.far]\nexpression = \"last\"\nabove = 1.0\n"
                "[response.left]\nexpression = \"2 * v - last\"\n"
                "[response.sooner]\nexpression = \"2 - when\"\n");
  const std::unique_ptr<Job> job = MakeJob(plan, std::vector{0.5}, {});
  std::vector<double> r(plan.responses.size());
  for (const double v : {0.3, 0.75}) {
    ASSERT_TRUE(job->Run(0, std::vector{v}, r).good);
    const bool passes = v > 0.5;
    EXPECT_NEAR(r[0], 2.0 * v, kClose);
    EXPECT_NEAR(r[1], 0.503 * v, kClose);
    EXPECT_NEAR(r[2], v, kClose);
    EXPECT_NEAR(r[3], 2.0 * v / std::sqrt(3.0), kClose);
    EXPECT_NEAR(r[4], 0.5 * v, kClose);
    EXPECT_NEAR(r[5], 0.5 * v, kClose);
    EXPECT_EQ(r[6], passes ? 1.0 : 0.0);
    EXPECT_EQ(r[8], passes ? 1.0 : 0.0);
    EXPECT_EQ(r[9], passes ? 1.0 : 0.0);
    EXPECT_NEAR(r[10], 0.0, kClose);
    if (passes) {
      EXPECT_NEAR(r[7], 1.0 / v, kClose);
      EXPECT_NEAR(r[11], 2.0 - 1.0 / v, kClose);
    } else {
      EXPECT_TRUE(std::isnan(r[7]));   // it did not happen
      EXPECT_TRUE(std::isnan(r[11]));  // nor has what follows from it a value
    }
  }
}

TEST(SceneJob, NumbersThatMakeNoSceneAreAFailedRun) {
  const OwnFolder folder;
  data::Campaign plan = BlockPlan(folder, "[response.r]\nquantity = \"block.x\"\n");
  plan.variables[0].keys = {"body.block.mass"};
  const std::unique_ptr<Job> job = MakeJob(plan, std::vector{0.5}, {});
  std::vector<double> r(1);
  const RunOutcome outcome = job->Run(0, std::vector{-1.0}, r);
  EXPECT_FALSE(outcome.good);
  EXPECT_THAT(outcome.message, HasSubstr("body.block.mass"));
  EXPECT_TRUE(std::isnan(r[0]));
}

TEST(SceneJob, NamesThatAreNotThereAreRefusedWithTheNearest) {
  const OwnFolder folder;
  EXPECT_THAT(Refused(BlockPlan(folder, "[response.r]\nquantity = \"blok.x\"\n")),
              HasSubstr("'block.x'"));
  EXPECT_THAT(Refused(BlockPlan(folder, "[response.r]\nevent = \"latch\"\n")),
              HasSubstr("no latches"));
  EXPECT_THAT(Refused(BlockPlan(folder, "[response.r]\nevent = \"watch\"\nwhere = \"pases\"\n")),
              HasSubstr("'passes'"));
  EXPECT_THAT(Refused(BlockPlan(folder, "[response.r]\nexpression = \"v + w\"\n")),
              HasSubstr("response.r.expression"));
  data::Campaign plan = BlockPlan(folder, "[response.r]\nquantity = \"block.x\"\n");
  plan.variables[0].keys = {"body.blok.mass"};
  EXPECT_THAT(Refused(plan), HasSubstr("body.blok"));
}

class StepsJobTest : public ::testing::Test {
 protected:
  data::Campaign Plan(const std::string& steps, const std::string& responses) const {
    folder_.Put("numbers.txt", "{{v}} {{v}}\n");
    folder_.Put("plan.toml", "[campaign]\nruns = 4\n[job]\nfiles = [\"numbers.txt\"]\n" + steps +
                                 "[variable.v]\nuniform = [1, 2]\n" + responses);
    return data::ReadCampaign(folder_.File("plan.toml"));
  }
  const OwnFolder folder_;
  const JobOptions allowed_{"/bin/false", true};
};

constexpr char kPrint[] =
    "[[job.step]]\nrun = [\"sh\", \"-c\", \"cat numbers.txt > copy.txt\"]\n"
    "[[job.step]]\nrun = [\"sh\", \"-c\", \"read a b < copy.txt; "
    "echo \\\"{\\\\\\\"a\\\\\\\": $a, \\\\\\\"r\\\\\\\": {run}, \\\\\\\"yes\\\\\\\": true, "
    "\\\\\\\"none\\\\\\\": null}\\\"\"]\n";

TEST_F(StepsJobTest, StepsShareAFolderAndSayNumbers) {
  const data::Campaign plan =
      Plan(kPrint,
           "[response.a]\npointer = \"/a\"\n[response.r]\npointer = \"/r\"\n"
           "[response.yes]\npointer = \"/yes\"\n"
           "[response.none]\npointer = \"/none\"\n"
           "[response.twice]\nexpression = \"2 * a\"\n");
  const std::unique_ptr<Job> job = MakeJob(plan, std::vector{1.5}, allowed_);
  std::vector<double> r(5);
  const RunOutcome outcome = job->Run(7, std::vector{1.0 / 3.0}, r);
  ASSERT_TRUE(outcome.good) << outcome.message;
  EXPECT_EQ(r[0], 1.0 / 3.0);  // every digit
  EXPECT_EQ(r[1], 7.0);
  EXPECT_EQ(r[2], 1.0);
  EXPECT_TRUE(std::isnan(r[3]));
  EXPECT_EQ(r[4], 2.0 / 3.0);
}

TEST_F(StepsJobTest, WhatFailsSaysWhereAndWhy) {
  const char* answer = "[response.a]\npointer = \"/a\"\n";
  const auto message = [&](const std::string& step) {
    const data::Campaign plan = Plan("[[job.step]]\nrun = [" + step + "]\n", answer);
    std::vector<double> r(1);
    const RunOutcome outcome =
        MakeJob(plan, std::vector{1.5}, allowed_)->Run(0, std::vector{1.5}, r);
    EXPECT_FALSE(outcome.good);
    EXPECT_TRUE(std::isnan(r[0]));
    return outcome.message;
  };
  EXPECT_THAT(message("\"sh\", \"-c\", \"echo why {v} >&2; exit 3\""),
              HasSubstr("exit code 3: why"));
  EXPECT_THAT(message("\"sh\", \"-c\", \"echo {v}; echo no json\""), HasSubstr("step 1: does not"));
  EXPECT_THAT(message("\"sh\", \"-c\", \"echo '{}' # {v}\""), HasSubstr("no number at /a"));
  EXPECT_THAT(message("\"no-such-program\", \"{v}\""), HasSubstr("does not start"));
}

TEST_F(StepsJobTest, ProgramsAreRunByLeaveAlone) {
  const std::string step = "[[job.step]]\nrun = [\"sh\", \"-c\", \"true {v}\"]\n",
                    answer = "[response.a]\npointer = \"/a\"\n";
  EXPECT_THAT(Refused(Plan(step, answer)), HasSubstr("--allow-programs"));
  EXPECT_EQ(Refused(Plan(step, answer), allowed_), "taken");
  EXPECT_THAT(Refused(Plan("[[job.step]]\nrun = [\"sh\", \"{w}\"]\n", answer), allowed_),
              HasSubstr("{w} stands for nothing"));
}

TEST_F(StepsJobTest, RunsThatWouldAllBeOneAreRefused) {
  data::Campaign plan = Plan("[[job.step]]\nrun = [\"sh\"]\n", "[response.a]\npointer = \"/a\"\n");
  EXPECT_EQ(Refused(plan, allowed_), "taken");  // the file has {{v}}
  plan.job.files.clear();
  EXPECT_THAT(Refused(plan, allowed_), HasSubstr("all runs would be one"));
}

}  // namespace
}  // namespace unfurl::campaign::job_test
