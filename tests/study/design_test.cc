// What to measure next, of a study of a pendulum: against fits of what was then measured.
#include "study/design.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "study/design_advice.h"
#include "tests/study/arm.h"

namespace unfurl::study::design_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class DesignTest : public ArmTest {
 protected:
  // Errors of both are of one record's noise: standard errors by differences about either estimate,
  // and residuals that happen to be correlated by some per cent.
  static void ExpectAlike(const std::vector<double>& planned, const std::vector<double>& found) {
    ASSERT_EQ(planned.size(), found.size());
    for (std::size_t j = 0; j < planned.size(); ++j) {
      EXPECT_NEAR(planned[j] / found[j], 1.0, 0.1) << j;
    }
  }

  static const DesignCase& Of(const std::vector<DesignCase>& cases, const std::string& name) {
    for (const DesignCase& c : cases) {
      if (c.name == name) return c;
    }
    throw Error("there is no " + name, "test", "");
  }
};

TEST_F(DesignTest, WhatItPromisesIsWhatAFitThenFinds) {
  DesignOptions options;
  options.candidates = data::ParseDesign(
      "[mark.far]\non = \"arm\"\npoint = [1.5, 0.0]\n"
      "[channel.encoder]\nquantity = \"hinge.theta\"\nunit = \"deg\"\nrate = 100\nsigma = 0.02\n"
      "[trial.high]\nset = [\"joint.hinge.theta=1.5\"]\n",
      "next.toml");
  const StudyDesign d = DesignStudy(Study("tracks.csv"), options);

  // What is there: the tip moves twice as far as the middle and tells more than three times as
  // much; both together all that is not known beforehand.
  ASSERT_EQ(d.tells.series.size(), 2U);
  EXPECT_GT(d.tells.series[1].share[0], 3.0 * d.tells.series[0].share[0]);
  EXPECT_NEAR(d.tells.series[0].share[0] + d.tells.series[1].share[0] + d.tells.priors[0], 1.0,
              1e-9);
  EXPECT_THAT(d.cycle, ElementsAre("mid", "tip", "dark"));
  EXPECT_NEAR(d.line, 0.01, 1e-9);
  ExpectAlike(d.again.alone, d.now);

  // The best cycle: the tip alone.
  EXPECT_THAT(d.schedule.cycle, ElementsAre("tip", "tip", "dark"));
  Record("better.csv", {"tip", "tip", ""}, {}, 2);
  ExpectAlike(d.schedule.alone, Fitted("better.csv"));

  // Two metres from the hinge the arm's end tells four times as much again.
  const DesignCase& far = Of(d.marks, "far");
  EXPECT_THAT(far.cycle, ElementsAre("far", "far", "dark"));
  Put("long.toml", "include = [\"arm.toml\"]\n[mark.far]\non = \"arm\"\npoint = [1.5, 0.0]\n");
  EXPECT_LT(far.alone[0], 0.6 * d.schedule.alone[0]);

  // An encoder as precise as the tip is (0.02 degrees of a metre: 0.35 mm) beside both.
  EXPECT_LT(Of(d.channels, "encoder").alone[0], 0.7 * d.now[0]);

  // Another start.
  Record("high.csv", {"mid", "tip", ""}, {"joint.hinge.theta=1.5"}, 3);
  ExpectAlike(Of(d.trials, "high").alone, Fitted("high.csv", "\"joint.hinge.theta=1.5\""));
  EXPECT_TRUE(d.notes.empty()) << d.notes.front();
}

// A mark in two lines of four, one upon the other, has missed none of its samples.
TEST_F(DesignTest, AnUnevenCycleIsReckonedAsItIs) {
  Record("uneven.csv", {"mid", "tip", "tip", ""}, {}, 4);
  const StudyDesign d = DesignStudy(Study("uneven.csv"), {});
  EXPECT_THAT(d.cycle, ElementsAre("mid", "tip", "tip", "dark"));
  ExpectAlike(d.again.alone, d.now);
}

TEST_F(DesignTest, WhatMattersAndWhatIsKeptIsTheUsersToSay) {
  DesignOptions options;
  options.wanted = {"damping"};
  options.kept = {"mid"};
  const StudyDesign d = DesignStudy(Study("tracks.csv"), options);
  EXPECT_THAT(d.wanted, ElementsAre("damping"));
  EXPECT_THAT(d.schedule.cycle, Contains("mid"));
  options.cycle = {"tip", "dark", "mid", "dark"};
  options.line_rate = 200.0;
  const StudyDesign other = DesignStudy(Study("tracks.csv"), options);
  EXPECT_EQ(other.cycle, options.cycle);
  EXPECT_NEAR(other.line, 5e-3, 1e-12);
  // Each mark every 20 ms, not every 30: errors by the root of that.
  EXPECT_NEAR(other.again.alone[0] / d.again.alone[0], std::sqrt(20.0 / 30.0), 0.05);
}

TEST_F(DesignTest, TheSameTrialUnderAnotherNameIsTheSame) {
  DesignOptions options;
  options.candidates =
      data::ParseDesign("[trial.same]\nset = [\"joint.hinge.theta=0.6\"]\n", "next.toml");
  const StudyDesign d = DesignStudy(Study("tracks.csv"), options);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_NEAR(Of(d.trials, "same").alone[j], d.again.alone[j], 1e-6 * d.again.alone[j]);
    EXPECT_NEAR(Of(d.trials, "same").together[j], d.again.together[j], 1e-6 * d.now[j]);
  }
}

TEST_F(DesignTest, BadInputIsNamed) {
  auto message = [&](const DesignOptions& options) {
    try {
      DesignStudy(Study("tracks.csv"), options);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("none");
  };
  DesignOptions options;
  options.wanted = {"dampng"};
  EXPECT_THAT(message(options), HasSubstr("no parameter 'dampng'"));
  options = {};
  options.trial = "B";
  EXPECT_THAT(message(options), HasSubstr("no trial 'B'"));
  options = {};
  options.kept = {"tipp"};
  EXPECT_THAT(message(options), HasSubstr("no mark 'tipp'"));
  options = {};
  options.cycle = {"nose"};
  EXPECT_THAT(message(options), HasSubstr("line_rate"));
  options.line_rate = 100.0;
  EXPECT_THAT(message(options), HasSubstr("no mark 'nose'"));
  options = {};
  options.candidates = data::ParseDesign("[mark.tip]\non = \"arm\"\n", "next.toml");
  EXPECT_THAT(message(options), HasSubstr("next.toml:1:mark.tip"));
  options.candidates = data::ParseDesign("[mark.new]\non = \"leg\"\n", "next.toml");
  EXPECT_THAT(message(options), HasSubstr("next.toml:1:mark.new"));
  options.candidates = data::ParseDesign(
      "[channel.a]\nquantity = \"hing.theta\"\nrate = 10\nsigma = 1\n", "next.toml");
  EXPECT_THAT(message(options), HasSubstr("did you mean 'hinge.theta'"));
  options.candidates =
      data::ParseDesign("[trial.a]\nset = [\"joint.hing.theta=1\"]\n", "next.toml");
  EXPECT_THAT(message(options), HasSubstr("next.toml:1:trial.a"));
  options.candidates = data::ParseDesign("[trial.a]\nset = [\"body.arm.mass=-1\"]\n", "next.toml");
  EXPECT_THAT(message(options), HasSubstr("next.toml:1:trial.a: body.arm.mass: -1"));
}

StudyDesign Weighed() {
  StudyDesign d;
  d.tells.parameters = {"stiffness", "damping"};
  d.wanted = d.tells.parameters;
  d.now = {1.0, 2.0};
  d.again = {"the same once more", "", {1.0, 2.0}, {0.7, 1.4}, {}};
  d.cycle = {"a", "b"};
  d.schedule = {"the best cycle", "", {1.0, 2.0}, {0.69, 1.38}, {"a", "a"}};
  d.trials = {{"high", "", {1.0, 2.0}, {0.3, 1.5}, {}},
              {"low", "", {1.0, 2.0}, {0.6, 0.8}, {}},
              {"broken", "does not start", {}, {}, {}}};
  d.fit.result.parameters.resize(2);
  for (auto& e : d.fit.result.parameters) e.sigma_data = 1.0, e.sigma_model = 0.1;
  return d;
}

// Geometric means over today's: 0.7 again, 0.69 by the cycle, 0.474 "high", 0.490 "low".
TEST(DesignAdvice, IsThePlanThatLeavesLeast) {
  StudyDesign d = Weighed();
  EXPECT_EQ(Advice(d),
            "Measure the trial high: the data's standard errors become 0.30 of today's (stiffness) "
            "and 0.75 (damping).");
  d.wanted = {"damping"};
  EXPECT_EQ(Advice(d),
            "Measure the trial low: the data's standard errors become 0.40 of today's (damping).");
}

TEST(DesignAdvice, NamesWhatTakesInAllCandidates) {
  StudyDesign d = Weighed();
  d.marks = {{kBestOfAll, "", {1.0, 2.0}, {0.2, 0.4}, {"a", "c"}}};
  EXPECT_THAT(Advice(d), HasSubstr("a trial with the best of all marks, in the cycle a c: the"));
  d.marks = {{kAllOfThese, "", {1.0, 2.0}, {0.2, 0.4}, {}}};
  EXPECT_THAT(Advice(d), HasSubstr("a trial with all of the candidate marks: the"));
  d.marks.clear();
  d.channels = {{kAllOfThese, "", {1.0, 2.0}, {0.2, 0.4}, {}}};
  EXPECT_THAT(Advice(d), HasSubstr("a trial with all of the candidate instruments: the"));
}

TEST(DesignAdvice, IsTheSameOnceMoreWhereNothingIsBetter) {
  StudyDesign d = Weighed();
  d.trials.clear();
  EXPECT_THAT(Advice(d), HasSubstr("Measure the same once more"));
  EXPECT_THAT(Advice(d), HasSubstr("0.70 of today's (stiffness) and 0.70 (damping)"));
}

TEST(DesignAdvice, IsABetterModelWhereItsOwnErrorIsTheLargerOne) {
  StudyDesign d = Weighed();
  d.fit.result.parameters[0].sigma_model = 1234.0;
  EXPECT_THAT(Advice(d), HasSubstr("Measure the trial high"));
  d.fit.result.parameters[1].sigma_model = 4.0;
  EXPECT_THAT(Advice(d), HasSubstr("Refine the model first: its own error is 1234 (stiffness), "
                                   "4.0 (damping) times what the data leave open. Then measure"));
}

}  // namespace
}  // namespace unfurl::study::design_test
