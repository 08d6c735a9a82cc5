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
  EXPECT_THAT(names(), ::testing::ElementsAre(
                           "quadratic dampers of the joints", "friction of the joints",
                           "springs of the joints, at rest at 0",
                           "springs of the joints, at rest at the start", "dampers of the sliders",
                           "quadratic dampers of the sliders", "friction of the sliders",
                           "springs of the sliders, at rest at 0"));
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

// A 250th of what gravity does; one at rest where the arm starts would move its middle as well.
TEST_F(SizedEffectsTest, ASpringThatTheSceneLacksIsMissed) {
  Record({.linear = 0.02, .stiffness = 0.02}, kSigma, 3);
  const TrialEffects e = WeighTrialEffects(LawStudy("damped", {"damper"}), {});
  const TrialEffect& spring = Of(e, "springs of the joints, at rest at 0");
  EXPECT_EQ(spring.verdict, EffectVerdict::kNeeded) << spring.message;
  EXPECT_NEAR(spring.size, 0.02, 4.0 * spring.size_sigma);
  EXPECT_NE(Of(e, "springs of the joints, at rest at the start").verdict, EffectVerdict::kNeeded);
}

// An arm that its spring drives into a latch whose stops meet where it latches.
TEST_F(SizedEffectsTest, ClearanceThatTheSceneLacksIsMissed) {
  const auto with = [](double stop) {
    return fmt::format(
        "[scene]\nname = \"arm\"\nduration = 6.0\n"
        "[contact.lock]\nK = 1e8\nC = 2e4\nQ = 3.0\nepsilon = 5e-6\n"
        "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
        "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\n"
        "outer_point = [-0.5, 0.0]\ntheta = 0.8\n"
        "[joint.hinge.spring]\nstiffness = 0.5\npreload = 0.5\n"
        "[joint.hinge.damper]\ndamping = 0.02\n"
        "[joint.hinge.latch]\ntheta_a = {0}\ntheta_b = {0}\nlever = 0.02\ncontact = \"lock\"\n",
        stop);
  };
  constexpr double kStop = 0.01;  // [rad]
  RecordScene(with(kStop), kSigma, 4);
  Put("latch.toml", with(0.0));
  const TrialEffects e = WeighTrialEffects(
      StudyOf("latch", "latch.toml", kSigma,
              "[parameter.stiffness]\nkeys = [\"joint.hinge.spring.stiffness\"]\nstart = 0.45\n"
              "bounds = [0.1, 2.0]\n"),
      {});
  const TrialEffect& clearance = Of(e, "clearance of the latches");
  EXPECT_EQ(clearance.verdict, EffectVerdict::kNeeded) << clearance.message;
  EXPECT_NEAR(clearance.size, kStop, 4.0 * clearance.size_sigma);
  EXPECT_LT(clearance.size_sigma, 0.02 * kStop);
}

// An arm on a table, held by a spring; its motion by a Runge-Kutta rule of this test's own.
class TableTest : public SizedEffectsTest {
 protected:
  static constexpr double kMass = 1.0, kArm = 0.5, kInertia = 1.0 / 12.0 + 0.25;  // about the pin
  static constexpr double kStiffness = 0.4, kDamping = 0.02, kStart = 0.6;

  // 600 readings of the angle, every 10 ms, of a table that is tilted.
  void RecordTilted(double gx, double gy, std::uint64_t seed) const {
    const auto rate = [&](double angle, double speed) {
      return (-kStiffness * angle - kDamping * speed +
              kMass * kArm * (gy * std::cos(angle) - gx * std::sin(angle))) /
             kInertia;
    };
    Rng rng(seed);
    std::string text = "t [s],angle [rad]\n";
    double angle = kStart, speed = 0.0;
    constexpr int kSteps = 10;  // to a reading: errors of 1e-12
    constexpr double h = 1e-3;  // [s]
    for (int i = 0; i < 600; ++i) {
      text += fmt::format("{:.4f},{:.9f}\n", 0.01 * i, angle + kSigma * rng.Normal());
      for (int k = 0; k < kSteps; ++k) {
        const double a = rate(angle, speed);
        const double v2 = speed + 0.5 * h * a, b = rate(angle + 0.5 * h * speed, v2);
        const double v3 = speed + 0.5 * h * b, c = rate(angle + 0.5 * h * v2, v3);
        const double v4 = speed + h * c, d = rate(angle + h * v3, v4);
        angle += h / 6.0 * (speed + 2.0 * v2 + 2.0 * v3 + v4);
        speed += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
      }
    }
    Put("angle.csv", text);
  }
  // Damping and stiffness are sought.
  TrialEffects WeighOnTable() const {
    Put("table.toml",
        "[scene]\nname = \"arm\"\nduration = 6.2\n"
        "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
        "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\n"
        "outer_point = [-0.5, 0.0]\ntheta = 0.6\n"
        "[joint.hinge.damper]\ndamping = 0.02\n[joint.hinge.spring]\nstiffness = 0.39\n"
        "[mark.tip]\non = \"arm\"\npoint = [0.5, 0.0]\n");
    return WeighTrialEffects(
        StudyOf("table", "table.toml", kSigma,
                "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.03\n"
                "bounds = [1e-6, 1.0]\n"
                "[parameter.stiffness]\nkeys = [\"joint.hinge.spring.stiffness\"]\n"
                "start = 0.39\nbounds = [0.01, 4.0]\n"),
        {});
  }
};

TEST_F(TableTest, ATiltIsMissedWithItsSign) {
  const double gy = -0.004;  // [m/s^2]: 0.4 mrad
  RecordTilted(0.0, gy, 11);
  const TrialEffects e = WeighOnTable();
  const TrialEffect& tilt = Of(e, "gravity along y");
  EXPECT_EQ(tilt.verdict, EffectVerdict::kNeeded) << tilt.message;
  EXPECT_NEAR(tilt.size, gy, 4.0 * tilt.size_sigma);
  EXPECT_LT(tilt.size_sigma, 0.2 * std::abs(gy));
}

// So much of it that the scene without it explains nothing: a fit with it does.
TEST_F(TableTest, AStrongTiltExplainsWhatNothingElseDoes) {
  RecordTilted(0.0, 0.1, 12);
  const TrialEffects e = WeighOnTable();
  EXPECT_FALSE(Explains(e.fit));
  const TrialEffect& tilt = Of(e, "gravity along y");
  EXPECT_EQ(tilt.verdict, EffectVerdict::kNeeded) << tilt.message;
  EXPECT_THAT(tilt.message, HasSubstr("with it the model explains the data"));
  EXPECT_NEAR(tilt.size, 0.1, 4.0 * tilt.size_sigma);
}

TEST_F(TableTest, ALevelTableIsNotToldToTilt) {
  const int seeds = Repeats(3, 60);
  double squares = 0.0;
  for (int seed = 1; seed <= seeds; ++seed) {
    RecordTilted(0.0, 0.0, static_cast<std::uint64_t>(seed));
    const TrialEffects e = WeighOnTable();
    for (const char* axis : {"gravity along x", "gravity along y"}) {
      const TrialEffect& tilt = Of(e, axis);
      EXPECT_NE(tilt.verdict, EffectVerdict::kNeeded) << seed << ": " << axis;
      squares += std::pow(tilt.size / tilt.size_sigma, 2);
    }
  }
  std::printf("squared sizes over stated %.2f of %d\n", squares / (2.0 * seeds), seeds);
  // Chance of 1e-4 on either side.
  EXPECT_GT(squares, ChiSquareQuantile(1e-4, 2.0 * seeds));
  EXPECT_LT(squares, ChiSquareQuantile(1.0 - 1e-4, 2.0 * seeds));
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
