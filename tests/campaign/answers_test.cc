// What runs say, on a motion in closed form.
#include "campaign/answers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "campaign/campaign.h"
#include "campaign/growth.h"
#include "tests/campaign/block.h"

namespace unfurl::campaign::answers_test {
namespace {

using ::testing::HasSubstr;

constexpr char kResponses[] =
    "[response.last]\nquantity = \"block.x\"\nof = \"final\"\nunit = \"m\"\n"
    "[response.when]\nevent = \"watch\"\nof = \"time\"\n"
    "[response.far]\nexpression = \"last\"\nabove = 1.6\n";

class AnswersTest : public ::testing::Test {
 protected:
  CampaignAnswers Answers(const std::string& campaign,
                          const std::string& variable = "uniform = [0.25, 1.0]\n",
                          const std::string& responses = kResponses) const {
    const OpenCampaign c =
        OpenPlan(BlockPlan(folder_, responses, campaign, variable), folder_.File("parts"), {});
    ComputePart(c, {0, c.inputs.runs()});
    MergeParts(c.folder, c.inputs, c.files, folder_.File("record.h5"));
    return Answer(ReadRecord(folder_.File("record.h5")));
  }
  const OwnFolder folder_;
};

// v is uniform on 0.25 .. 1: the block ends at 2 v, and is beyond 1.6 m where v > 0.8.
TEST_F(AnswersTest, ProbabilitiesAndDistributionsAreThoseOfTheMotion) {
  for (const char* design : {"latin", "sobol", "random", "saltelli"}) {
    const CampaignAnswers a = Answers(std::string("runs = 600\nseed = 3\nname = \"") + design +
                                      "\"\ndesign = \"" + design + "\"\n");
    std::filesystem::remove_all(folder_.File("parts"));
    ASSERT_EQ(a.responses.size(), 3U) << design;
    const ResponseAnswer &last = a.responses[0], &when = a.responses[1], &far = a.responses[2];
    ASSERT_TRUE(last.summary && when.summary && far.proportion) << design;
    const double p = 0.2 / 0.75, mean = 1.25, sigma = 1.5 / std::sqrt(12.0);
    EXPECT_LE(far.proportion->interval.low, p) << design;
    EXPECT_GE(far.proportion->interval.high, p) << design;
    EXPECT_NEAR(last.summary->mean, mean, 5.0 * last.summary->mean_error) << design;
    EXPECT_GE(last.summary->sigma_interval.high, sigma * 0.99) << design;
    EXPECT_LE(last.summary->sigma_interval.low, sigma * 1.01) << design;
    // A third of the blocks never passes.
    EXPECT_NEAR(static_cast<double>(when.absent) / static_cast<double>(a.runs), 1.0 / 3.0, 0.06)
        << design;
    EXPECT_EQ(when.present + when.absent, a.runs) << design;
    EXPECT_THAT(a.notes, ::testing::Contains(HasSubstr("have no when"))) << design;
    EXPECT_TRUE(a.usable);
  }
}

TEST_F(AnswersTest, GridsGiveExtremesAndNoProbabilities) {
  const CampaignAnswers a = Answers("design = \"grid\"\n", "values = [0.3, 0.9, 0.6]\n");
  EXPECT_EQ(a.runs, 3U);
  EXPECT_FALSE(a.responses[0].summary.has_value());
  EXPECT_FALSE(a.responses[2].proportion.has_value());
  EXPECT_NEAR(a.responses[0].minimum, 0.6, 1e-9);
  EXPECT_NEAR(a.responses[0].maximum, 1.8, 1e-9);
  EXPECT_EQ(a.responses[0].maximum_run, 1U);
  EXPECT_THAT(a.notes, ::testing::Contains(HasSubstr("no probabilities follow")));
}

// The end hangs on v alone, though two variables are there.
TEST_F(AnswersTest, SharesOfTheVarianceAreThoseOfTheMotion) {
  const std::string two =
      "uniform = [0.25, 1.0]\n[variable.w]\nkeys = [\"body.block.velocity[1]\"]\n"
      "uniform = [-1, 1]\n";
  const std::string responses =
      "[response.last]\nquantity = \"block.x\"\nof = \"final\"\n"
      "[response.sum]\nexpression = \"v + w\"\n";
  const CampaignAnswers a = Answers("design = \"saltelli\"\nruns = 2000\n", two, responses);
  ASSERT_TRUE(a.responses[0].indices && a.responses[1].indices);
  EXPECT_TRUE(a.responses[0].indices->usable);
  EXPECT_NEAR(a.responses[0].indices->inputs[0].total, 1.0, 0.05);
  EXPECT_NEAR(a.responses[0].indices->inputs[1].total, 0.0, 0.01);
  // Variances of the two are as 0.75^2 to 2^2.
  EXPECT_NEAR(a.responses[1].indices->inputs[1].first, 4.0 / 4.5625, 0.05);
  std::filesystem::remove_all(folder_.File("parts"));
  const CampaignAnswers m = Answers("design = \"morris\"\nruns = 60\n", two, responses);
  ASSERT_TRUE(m.responses[0].screening.has_value());
  EXPECT_EQ(m.responses[0].screening->inputs[0].rank, 1);
  EXPECT_NEAR(m.responses[0].screening->inputs[0].mu_star, 1.5, 1e-6);  // 2 times 0.75
}

TEST_F(AnswersTest, RunsThatAllFailAreNoAnswer) {
  data::Campaign plan = BlockPlan(folder_, kResponses, "runs = 5\n", "uniform = [-2, -1]\n");
  plan.variables[0].keys = {"body.block.mass"};
  // Names are looked at with the median, which fails like all others.
  EXPECT_THROW(OpenPlan(plan, folder_.File("parts"), {}), Error);
}

TEST_F(AnswersTest, GoalsAreReadStrictly) {
  const data::Campaign plan = BlockPlan(folder_, kResponses);
  const Goal p = ParseGoal("P(far) +- 0.002", plan, "here");
  EXPECT_EQ(p.kind, AnswerKind::kProbability);
  EXPECT_EQ(p.half, 0.002);
  EXPECT_FALSE(p.relative);
  const Goal mean = ParseGoal("mean( last ) \u00b1 1%", plan, "here");
  EXPECT_EQ(mean.kind, AnswerKind::kMean);
  EXPECT_TRUE(mean.relative);
  EXPECT_EQ(mean.half, 0.01);
  const Goal q = ParseGoal("quantile(last, 0.99) +- 0.1", plan, "here");
  EXPECT_EQ(q.p, 0.99);
  for (const char* wrong : {"P(far)", "P(far) +- 0", "P(far) +- -1", "P(last) +- 0.1",
                            "mean(far) +- 1", "quantile(last) +- 1", "quantile(last, 1.0) +- 1",
                            "P(fat) +- 0.1", "far +- 0.1", "", "P(far, 0.5) +- 0.1"}) {
    EXPECT_THROW(ParseGoal(wrong, plan, "here"), Error) << wrong;
  }
}

}  // namespace
}  // namespace unfurl::campaign::answers_test
