// What a run's summary is made of, on reports written by hand.

#include "sim/record/run_summary.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/sim/scenes.h"

namespace unfurl::sim::run_summary_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Three bars in a row on free pins.
const char* const kChain =
    "[scene]\nname = \"chain\"\nduration = 1.0\n"
    "[body.a]\nmass = 0.5\ninertia = 0.02\n"
    "[body.b]\nmass = 0.5\ninertia = 0.02\n"
    "[body.c]\nmass = 0.5\ninertia = 0.02\n"
    "[joint.first]\ninner = \"ground\"\nouter = \"a\"\nouter_point = [-0.3, 0.0]\n"
    "[joint.second]\ninner = \"a\"\ninner_point = [0.3, 0.0]\nouter = \"b\"\nouter_point = [-0.3, "
    "0.0]\n"
    "[joint.third]\ninner = \"b\"\ninner_point = [0.3, 0.0]\nouter = \"c\"\nouter_point = [-0.3, "
    "0.0]\n";

struct Summary {
  explicit Summary(const std::string& toml)
      : model(ModelFrom(toml)), recorder(model, {}, 50.0, 100.0, false) {
    report.steps = 1000;
    report.t_end = 1.0;
    report.worst_bodies.assign(static_cast<std::size_t>(model.rigid_bodies.count), 0);
  }
  SummaryInput Input() const {
    return {model, report, recorder, "good", "", "s.toml", "chain", "r.h5", false};
  }

  Model model;
  SimulateReport report;
  RunRecorder recorder;
};

// Shares of the steps by what limited them; those under half a percent are left out.
TEST(RunSummary, StepLimitsAreSharesOfTheSteps) {
  Summary s(kChain);
  const int last = kStepLimits - 1;
  s.report.limited[static_cast<std::size_t>(StepLimit::kError)] = 700;
  s.report.limited[static_cast<std::size_t>(StepLimit::kMaxStep)] = 296;
  s.report.limited[last] = 4;
  EXPECT_EQ(LimitSentence(s.Input()), "error 70 %, max_step 30 %");
  s.report.worst_bodies[1] = 3;
  s.report.worst_bodies[2] = 2;
  EXPECT_THAT(LimitSentence(s.Input()), HasSubstr("error 70 % (mostly "));
  EXPECT_THAT(LimitSentence(s.Input()), HasSubstr("'b'"));
  EXPECT_THAT(LimitSentence(s.Input()), HasSubstr("), max_step 30 %"));
  s.report.limited[last] = 6;
  EXPECT_THAT(LimitSentence(s.Input()),
              HasSubstr(fmt::format(", {} 1 %", LimitName(static_cast<StepLimit>(last)))));
  s.report.steps = 0;
  EXPECT_EQ(LimitSentence(s.Input()), "");
}

// Every limit is in the record once, by its name.
TEST(RunSummary, EveryLimitIsRecorded) {
  Summary s(kChain);
  for (int k = 0; k < kStepLimits; ++k) s.report.limited[static_cast<std::size_t>(k)] = 10 + k;
  nlohmann::ordered_json json;
  SummaryText(s.Input(), &json);
  ASSERT_EQ(json["limits"].size(), static_cast<std::size_t>(kStepLimits));
  for (int k = 0; k < kStepLimits; ++k)
    EXPECT_EQ(json["limits"][LimitName(static_cast<StepLimit>(k))], 10 + k);
  EXPECT_EQ(json["steps"], 1000);
  EXPECT_EQ(json["joints"].size(), 3U);
}

// Gravity and a suspension have no number, however many bodies they act on.
TEST(RunSummary, WhatHasNoPluralIsNotCounted) {
  EXPECT_THAT(
      EffectsText(Summary(std::string(kChain) + "[gravity]\nacceleration = [0.0, -9.8]\n").model),
      AllOf(HasSubstr("3 bodies, gravity"), Not(HasSubstr("3 gravity"))));
  EXPECT_THAT(EffectsText(Summary(std::string(kChain) + "[suspension]\nlength = 7.0\n").model),
              AllOf(HasSubstr(", suspension"), Not(HasSubstr("3 suspension"))));
}

// Of a hundred beams alike nobody reads each warning; the JSON has them.
TEST(RunSummary, ManyWarningsAreCounted) {
  Summary s(kChain);
  for (int k = 0; k < 6; ++k) s.report.warnings.push_back(fmt::format("beam {}", k));
  EXPECT_EQ(ShownWarnings(s.Input()), s.report.warnings);
  for (int k = 6; k < 100; ++k) s.report.warnings.push_back(fmt::format("beam {}", k));
  const std::vector<std::string> shown = ShownWarnings(s.Input());
  ASSERT_EQ(shown.size(), 6U);
  EXPECT_EQ(shown[4], "beam 4");
  EXPECT_THAT(shown[5], HasSubstr("95 more warnings"));
}

// A table keeps the joints with the largest loads, in the order of the scene.
TEST(RunSummary, TheJointTableKeepsTheLargestLoads) {
  Summary s(kChain);
  s.report.peak_pin_force = {20.0, 10.0, 30.0};
  s.report.peak_pin_time = {0.1, 0.2, 0.3};
  std::size_t left_out = 9;
  EXPECT_EQ(JointTable(s.Input(), 3, &left_out).size(), 4U);
  EXPECT_EQ(left_out, 0U);
  const auto rows = JointTable(s.Input(), 2, &left_out);
  EXPECT_EQ(left_out, 1U);
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_THAT(rows[1], ElementsAre("first", "20", "0.1000"));
  EXPECT_THAT(rows[2], ElementsAre("third", "30", "0.3000"));
  EXPECT_EQ(LatchSentence(s.Input()), "");
}

// The median of what was counted in bins of 0.001, whatever its order; what rebounds past the bins,
// or is no number, is kept in the outermost.
TEST(LatchCount, MedianOfTheRestitutions) {
  LatchCount count;
  EXPECT_TRUE(std::isnan(count.MedianRestitution()));
  for (const double value : {0.9, 0.1005, 0.3505, 0.2005, 0.8}) count.AddRestitution(value);
  EXPECT_EQ(count.ended, 5);
  EXPECT_NEAR(count.MedianRestitution(), 0.3505, 1e-9);
  for (int k = 0; k < 5; ++k) count.AddRestitution(7.0);
  EXPECT_NEAR(count.MedianRestitution(), 0.9, 1e-3);
  for (int k = 0; k < 7; ++k) count.AddRestitution(NAN);
  EXPECT_NEAR(count.MedianRestitution(), 0.2005, 1e-9);
}

}  // namespace
}  // namespace unfurl::sim::run_summary_test
