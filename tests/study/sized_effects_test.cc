// Effects that a scene lacks, of a size that the trial tells.
#include "study/sized_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/statistics.h"
#include "study/rivals.h"
#include "study/trial_effects.h"
#include "tests/repeats.h"
#include "tests/study/swing.h"

namespace unfurl::study::sized_effects_test {
namespace {

using ::testing::HasSubstr;

class SizedEffectsTest : public SwingTest {
 protected:
  static constexpr double kSigma = 1e-3;  // [rad]

  // Of a pendulum of which the stiffness of a spring alone is sought.
  TrialEffects Weigh() const {
    Put("spring.toml", Scene("[joint.hinge.spring]\nstiffness = 0.1\n"));
    return WeighTrialEffects(
        StudyOf("spring", "spring.toml", kSigma,
                "[parameter.stiffness]\nkeys = [\"joint.hinge.spring.stiffness\"]\nstart = 0.1\n"
                "bounds = [1e-9, 2.0]\n"),
        {});
  }
  static const TrialEffect& Of(const TrialEffects& e, const std::string& name) {
    for (const TrialEffect& one : e.effects) {
      if (one.effect.name == name) return one;
    }
    throw Error("there is no effect " + name, "test", "");
  }
};

TEST_F(SizedEffectsTest, AreThoseThatTheSceneLacksAndTheStudyDoesNotFit) {
  const data::Scene scene = data::ParseScene(
      Scene("[joint.hinge.damper]\ndamping = 0.1\n") +
          "[body.cart]\nmass = 2.0\ninertia = 0.1\n[joint.rail]\ntype = \"slider\"\n"
          "inner = \"ground\"\nouter = \"cart\"\n",
      "scene");
  data::Study study;
  const auto names = [&] {
    std::vector<std::string> out;
    for (const SizedEffect& one : SizedEffectsOf(scene, study)) out.push_back(one.name);
    return out;
  };
  EXPECT_THAT(names(),
              ::testing::ElementsAre("quadratic dampers of the joints", "friction of the joints",
                                     "dampers of the sliders", "quadratic dampers of the sliders",
                                     "friction of the sliders"));
  study.parameters.push_back({"p", "", {"joint.hinge.friction.moment"}});
  EXPECT_THAT(names(), ::testing::Not(::testing::Contains("friction of the joints")));
}

// Sizes over redraws of the noise, against what is planted and the errors that are stated.
TEST_F(SizedEffectsTest, SizesScatterAsTheirErrorsSay) {
  const int seeds = Repeats(6, 60);
  double sum = 0.0, needed = 0.0, others = 0.0;
  for (int seed = 1; seed <= seeds; ++seed) {
    Record({.linear = 0.003, .stiffness = 0.12}, kSigma, static_cast<std::uint64_t>(seed));
    const TrialEffects e = Weigh();
    const TrialEffect& damper = Of(e, "dampers of the joints");
    EXPECT_GT(damper.probability, 0.99) << seed << ": " << damper.message;
    EXPECT_EQ(damper.unit, "N m s/rad");
    // Over so few swings the laws differ little: that one is missed is plain, and not which.
    if (damper.verdict != EffectVerdict::kNeeded) {
      EXPECT_EQ(damper.verdict, EffectVerdict::kCannotTell);
      EXPECT_THAT(damper.message, HasSubstr("the scene lacks one of dampers of the joints"));
    }
    sum += std::pow((damper.size - 0.003) / damper.size_sigma, 2);
    for (const TrialEffect& one : e.effects) {
      if (one.unit.empty() || one.verdict != EffectVerdict::kNeeded) continue;
      (&one == &damper ? needed : others) += 1.0;
    }
  }
  std::printf("squared errors over stated %.2f of %d; needed %.0f times, another %.0f\n",
              sum / seeds, seeds, needed, others);
  EXPECT_EQ(others, 0.0);
  // Chance of 1e-4 on either side.
  EXPECT_GT(sum, ChiSquareQuantile(1e-4, seeds));
  EXPECT_LT(sum, ChiSquareQuantile(1.0 - 1e-4, seeds));
}

TEST_F(SizedEffectsTest, WhatIsNotThereIsNotNeeded) {
  const int seeds = Repeats(6, 60);
  for (int seed = 1; seed <= seeds; ++seed) {
    Record({.stiffness = 0.12}, kSigma, static_cast<std::uint64_t>(100 + seed));
    const TrialEffects e = Weigh();
    int sized = 0;
    for (const TrialEffect& one : e.effects) {
      if (one.unit.empty()) continue;
      ++sized;
      EXPECT_NE(one.verdict, EffectVerdict::kNeeded) << seed << ": " << one.effect.name;
      EXPECT_LT(one.size, 5.0 * one.size_sigma) << seed << ": " << one.effect.name;
      EXPECT_GT(one.size_sigma, 0.0) << seed << ": " << one.effect.name;
    }
    EXPECT_EQ(sized, 3);
  }
}

// By a damper ten times as strong swings fade as by no other law.
TEST_F(SizedEffectsTest, TheLawThatTakesMostIsTheOne) {
  Record({.linear = 0.03, .stiffness = 0.12}, kSigma, 5);
  const TrialEffects e = Weigh();
  const TrialEffect& damper = Of(e, "dampers of the joints");
  EXPECT_EQ(damper.verdict, EffectVerdict::kNeeded) << damper.message;
  EXPECT_NEAR(damper.size, 0.03, 4.0 * damper.size_sigma);
  for (const char* other : {"quadratic dampers of the joints", "friction of the joints"}) {
    EXPECT_NE(Of(e, other).verdict, EffectVerdict::kNeeded) << other;
  }
}

// So much of it that the model as it is explains nothing.
TEST_F(SizedEffectsTest, WhatTheModelMissesIsNamedWhereNothingElseCanBeTold) {
  Record({.quadratic = 0.08, .stiffness = 0.12}, kSigma, 1);
  const TrialEffects e = Weigh();
  ASSERT_TRUE(e.fit.Usable());
  EXPECT_FALSE(Explains(e.fit));
  const TrialEffect& quadratic = Of(e, "quadratic dampers of the joints");
  EXPECT_EQ(quadratic.verdict, EffectVerdict::kNeeded) << quadratic.message;
  EXPECT_THAT(quadratic.message, HasSubstr("with it the model explains the data"));
  EXPECT_NEAR(quadratic.size, 0.08, 4.0 * quadratic.size_sigma);
  EXPECT_LT(quadratic.size_sigma, 0.01);
  for (const char* other : {"dampers of the joints", "friction of the joints"}) {
    EXPECT_NE(Of(e, other).verdict, EffectVerdict::kNeeded) << other;
  }
}

}  // namespace
}  // namespace unfurl::study::sized_effects_test
