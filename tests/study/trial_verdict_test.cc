// What is said of effects where the model beside them is wrong, by rules and by trials.
#include "study/trial_verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "correlate/fit/refit.h"
#include "study/effect_versions.h"
#include "tests/study/swing.h"

namespace unfurl::study::trial_verdict_test {
namespace {

using ::testing::HasSubstr;

constexpr double kRows = 600.0;

TrialEffect Seen(const std::string& name, bool there, double deviance, double share) {
  TrialEffect e;
  e.effect = {name, there, {}};
  e.fitted = e.settled = true;
  e.deviance = e.deviance_least = deviance;
  e.share = share;
  e.probability = ProbabilityOfEffect(deviance, kRows, e);
  return e;
}

EffectVerdict Judged(TrialEffect e, bool explained) {
  JudgeEffect({.part = 0.3, .rows = kRows, .explained = explained}, &e);
  return e.verdict;
}

TEST(TrialVerdict, OfAFitThatDoesNotExplainOnlyWhatTakesNearlyAll) {
  const TrialEffect half = Seen("friction", true, 400.0, 0.5);
  EXPECT_EQ(Judged(half, true), EffectVerdict::kNeeded);
  EXPECT_EQ(Judged(half, false), EffectVerdict::kCannotTell);
  EXPECT_EQ(Judged(Seen("gravity", true, 1e6, 0.9994), false), EffectVerdict::kNeeded);
  EXPECT_EQ(Judged(Seen("drag", true, -1e-3, 0.0), true), EffectVerdict::kNotNeeded);
  EXPECT_EQ(Judged(Seen("drag", true, -1e-3, 0.0), false), EffectVerdict::kCannotTell);
  TrialEffect wrong = Seen("drag", true, -40.0, 0.0);
  wrong.change = 0.5;
  EXPECT_EQ(Judged(wrong, true), EffectVerdict::kAgainst);
  EXPECT_EQ(Judged(wrong, false), EffectVerdict::kCannotTell);
}

TEST(TrialVerdict, AChangeThatIsHardlyKnownIsNotSmall) {
  TrialEffect e = Seen("friction", true, 0.1, 0.0);
  e.released = {"friction"};
  e.change = 0.1;
  e.change_sigma = 0.11;  // 0.1 + 1.645 * 0.11 = 0.28
  EXPECT_EQ(Judged(e, true), EffectVerdict::kNotNeeded);
  e.change_sigma = 0.13;  // 0.31
  JudgeEffect({.part = 0.3, .rows = kRows, .explained = true}, &e);
  EXPECT_EQ(e.verdict, EffectVerdict::kCannotTell);
  EXPECT_THAT(e.message, HasSubstr("known to 0.13 only"));
}

// The reason given is the one that keeps it from "not needed".
TEST(TrialVerdict, WhatIsNotSmallIsNamed) {
  const auto why = [](double change, double change_sigma, double shift) {
    TrialEffect e = Seen("drag", true, 0.1, 0.0);
    e.change = change;
    e.change_sigma = change_sigma;
    e.shifts = {{"stiffness", 0.01}, {"inertia", shift}};
    JudgeEffect({.part = 0.3, .rows = kRows, .explained = true}, &e);
    return e.verdict == EffectVerdict::kNotNeeded ? "not needed" : e.message;
  };
  EXPECT_EQ(why(0.19, 0.02, 0.29), "not needed");
  EXPECT_THAT(why(0.19, 0.02, -0.36), HasSubstr("moves inertia by 0.36 of a standard error"));
  EXPECT_THAT(why(0.19, 0.10, -0.36), HasSubstr("known to 0.1 only"));
  EXPECT_THAT(why(0.41, 0.02, 0.1), HasSubstr("0.41 of a sigma apart"));
}

TEST(TrialVerdict, WhatDidNotSettleIsSaidToBeThat) {
  TrialEffect e = Seen("gravity", true, 5e4, 0.9);
  e.deviance_least = -600.0;
  const auto why = [&](bool settled) {
    e.settled = settled;
    JudgeEffect({.part = 0.3, .rows = kRows, .explained = true}, &e);
    return e.message;
  };
  EXPECT_THAT(why(false), HasSubstr("not settled within"));
  EXPECT_THAT(why(true), HasSubstr("values of the parameters"));
}

TEST(TrialVerdict, BesideAWrongOneNothingIsNotNeeded) {
  auto verdict = [](TrialEffect beside) {
    TrialEffect small = Seen("drag", true, 0.0, 0.0);
    small.verdict = EffectVerdict::kNotNeeded;
    std::vector<TrialEffect> both = {small, std::move(beside)};
    DoubtBesideOthers(&both);
    return both[0].verdict == EffectVerdict::kNotNeeded ? "" : both[0].message;
  };
  TrialEffect e = Seen("friction", true, -40.0, 0.0);
  e.verdict = EffectVerdict::kAgainst;
  EXPECT_THAT(verdict(e), HasSubstr("contradicts friction"));
  e.verdict = EffectVerdict::kCannotTell;
  EXPECT_EQ(verdict(e), "");
  e.released = {"mu"};  // which might have been 0
  EXPECT_THAT(verdict(e), HasSubstr("better without friction"));
  e = Seen("a finer mesh", false, 40.0, 0.5);
  e.verdict = EffectVerdict::kNeeded;
  EXPECT_THAT(verdict(e), HasSubstr("the scene lacks a finer mesh"));
  e.effect.there = true;
  EXPECT_EQ(verdict(e), "");
}

class WrongBesideTest : public SwingTest {
 protected:
  // A record with linear damping; the scene has a fixed quadratic one too, that does its work.
  TrialEffects Weigh(double quadratic) const {
    Record({.linear = 0.004}, 1e-3, 5);
    Put("scene.toml", Scene(Laws{.linear = 0.01, .quadratic = quadratic}));
    return WeighTrialEffects(
        StudyOf("wrong", "scene.toml", 1e-3,
                "[parameter.linear]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.01\n"
                "bounds = [1e-9, 0.2]\n[parameter.inertia]\nkeys = [\"body.arm.inertia\"]\n"
                "start = 0.09\nbounds = [0.01, 0.2]\n"),
        {});
  }
  static EffectVerdict Of(const TrialEffects& all, const std::string& name) {
    for (const TrialEffect& e : all.effects) {
      if (e.effect.name == name) return e.verdict;
    }
    return EffectVerdict::kUnjudged;
  }
};

TEST_F(WrongBesideTest, TheRightOneIsNotLeftOut) {
  const TrialEffects with = Weigh(0.008);
  ASSERT_TRUE(with.fit.Usable()) << with.fit.result.message;
  EXPECT_NE(Of(with, "dampers of the joints"), EffectVerdict::kNotNeeded);
  EXPECT_TRUE(with.left_out.empty());
  const TrialEffects without = Weigh(0.0);
  EXPECT_EQ(Of(without, "dampers of the joints"), EffectVerdict::kNeeded);
}

// Without the spring there is no moment of it: that is no run that failed.
TEST_F(WrongBesideTest, WhatAChannelRecordsIsNotWeighedByIt) {
  constexpr double kStiffness = 2.0;
  Record({.linear = 0.02, .stiffness = kStiffness}, 1e-3, 5);
  std::string moments = "t [s],cell [N m]\n";
  for (int i = 0; i < 580; ++i) moments += fmt::format("{:.4f},{:.6f}\n", 0.01 * i, 0.0);
  Put("moment.csv", moments);
  Put("scene.toml", Scene(Laws{.linear = 0.02, .stiffness = kStiffness}));
  const TrialEffects all = WeighTrialEffects(
      StudyOf("cell", "scene.toml", 1e-3,
              "[trial.channel.cell]\nfile = \"moment.csv\"\nquantity = \"hinge.spring_moment\"\n"
              "sigma = 100.0\n"
              "[parameter.c]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.01\n"
              "bounds = [1e-9, 0.2]\n"),
      {});
  ASSERT_TRUE(all.fit.Usable()) << all.fit.result.message;
  EXPECT_EQ(all.fit.record.verdict, "c is determined.");  // a symbol is no word to begin with
  EXPECT_EQ(Of(all, "springs of the joints"), EffectVerdict::kCannotTell);
  for (const TrialEffect& e : all.effects) {
    if (e.effect.name == "springs of the joints") {
      EXPECT_THAT(e.message, HasSubstr("channel cell records it ('hinge.spring_moment')"));
    }
  }
}

// Friction below zero, with more linear damping, would do what the quadratic one does: bounds say
// that there is none.
TEST_F(WrongBesideTest, ValuesBeyondTheirBoundsTakeNothingOver) {
  Record({.quadratic = 0.02}, 1e-3, 7);
  const std::string joint =
      "[joint.hinge.friction]\nmoment = 0.01\ncreep_rate = 0.05\n"
      "[joint.hinge.quadratic_damper]\ndamping = 0.02\n[joint.hinge.damper]\ndamping = 0.01\n";
  Put("three.toml", Scene(joint));
  std::string parameters;
  for (const char* key : {"damper.damping", "quadratic_damper.damping", "friction.moment"}) {
    parameters += fmt::format(
        "[parameter.p{}]\nkeys = [\"joint.hinge.{}\"]\nstart = 0.01\nbounds = [1e-9, 0.2]\n",
        parameters.size(), key);
  }
  const TrialEffects all = WeighTrialEffects(StudyOf("three", "three.toml", 1e-3, parameters), {});
  ASSERT_TRUE(all.fit.Usable()) << all.fit.result.message;
  for (const TrialEffect& e : all.effects) {
    if (e.effect.name != "quadratic dampers of the joints") continue;
    EXPECT_EQ(e.verdict, EffectVerdict::kNeeded);
    EXPECT_NEAR(e.deviance_least, e.deviance, 0.01 * e.deviance);
  }
}

// One standard error of a parameter, all others following, moves white rows by one over the root of
// their number, whatever the model.
TEST_F(WrongBesideTest, AStandardErrorMovesWhiteRowsByOneInAll) {
  Record({.linear = 0.02, .quadratic = 0.01}, 1e-3, 7);
  const data::Study study = LawStudy("both", {"damper", "quadratic_damper"});
  const StudyFit fit = Fit(study, {});
  ASSERT_TRUE(fit.Usable());
  const EffectVersions versions(study, fit);
  const EffectVersion same = versions.AsItIs();
  const correlate::Refits refits(fit.problem(), fit.result, fit.binding->options);
  const correlate::Refitted r = refits.Refit(same.binding.problem, {.workers = 1});
  ASSERT_EQ(r.moves.size(), 2U);
  const double scale = std::max(1.0, r.whitened[0].squaredNorm() / r.rows);
  for (const double move : r.moves) {
    EXPECT_NEAR(move, std::sqrt(scale / r.rows), 1e-6 * move);
  }
}

}  // namespace
}  // namespace unfurl::study::trial_verdict_test
