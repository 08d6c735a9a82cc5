// Which effects of a scene and of a trial count.
#include "study/effects.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <numbers>

#include "base/error.h"
#include "base/random.h"
#include "data/atomic_file.h"
#include "study/scene_model.h"
#include "study/trial_effects.h"

namespace unfurl::study::effects_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class EffectsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::path(::testing::TempDir()) / fmt::format("unfurl_effects-{}", getpid());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Put(const std::string& name, const std::string& text) const {
    data::WriteTextFile((folder_ / name).string(), text);
    return (folder_ / name).string();
  }

  // A pendulum with a damper, a drop of quadratic damping, and a spring beside its gravity.
  std::string Pendulum(double damping, double quadratic, double stiffness) const {
    return Put("pendulum.toml",
               fmt::format("[scene]\nname = \"pendulum\"\nduration = 6.0\n"
                           "[gravity]\nacceleration = [0.0, -9.81]\n"
                           "[body.arm]\nmass = 1.0\ninertia = 0.08333333333333333\n"
                           "[joint.hinge]\ninner = \"ground\"\nouter = \"arm\"\n"
                           "outer_point = [-0.5, 0.0]\nzero_angle = -1.5707963267948966\n"
                           "theta = 0.6\n[joint.hinge.damper]\ndamping = {}\n"
                           "[joint.hinge.quadratic_damper]\ndamping = {}\n"
                           "[joint.hinge.spring]\nstiffness = {}\n"
                           "[mark.tip]\non = \"arm\"\npoint = [0.5, 0.0]\n",
                           damping, quadratic, stiffness));
  }

  static const EffectChange& Of(const SceneEffects& e, const std::string& name) {
    for (const EffectChange& c : e.effects) {
      if (c.effect.name == name) return c;
    }
    throw Error("there is no effect " + name, "test", "");
  }

  std::filesystem::path folder_;
};

TEST_F(EffectsTest, WhatNobodyCanSeeIsNotNeeded) {
  const std::string scene = Pendulum(0.02, 1e-6, 1e-4);
  SceneEffectsOptions options;
  options.sigma = 2e-4;
  options.rtol = 1e-9;
  const SceneEffects e = WeighEffects(scene, {}, options);
  EXPECT_EQ(Of(e, "gravity").verdict, EffectVerdict::kNeeded);
  EXPECT_EQ(Of(e, "dampers of the joints").verdict, EffectVerdict::kNeeded);
  EXPECT_EQ(Of(e, "quadratic dampers of the joints").verdict, EffectVerdict::kNotNeeded);
  EXPECT_LT(e.floor, 1e-6);
  EXPECT_THAT(e.left_out, ::testing::Contains("quadratic dampers of the joints"));
  EXPECT_LE(e.reduced_rms, options.part * options.sigma);
  // The change by hand: a spring of k turns the pendulum's stiffness m g l into m g l + k, so that
  // its phase is ahead by pi f t k / (m g l) after t.
  const double stiffness = 1e-4 / (9.81 * 0.5);
  const double frequency = std::sqrt(9.81 * 0.5 / (1.0 / 12.0 + 0.25)) / (2.0 * std::numbers::pi);
  const double phase = std::numbers::pi * frequency * 6.0 * stiffness;
  const double amplitude = 0.6 * std::exp(-0.5 * 0.02 * 6.0 / (1.0 / 12.0 + 0.25));
  EXPECT_NEAR(Of(e, "springs of the joints").largest, amplitude * phase, 0.2 * amplitude * phase);
  // The file that is written runs, and without it.
  const std::string reduced = Put("reduced.toml", ReducedScene(scene, {}, e.set));
  const data::Scene back = data::ReadScene(reduced);
  EXPECT_FALSE(back.joints[0].quadratic_damper);
  EXPECT_TRUE(back.joints[0].damper);
}

TEST_F(EffectsTest, WithoutASigmaNothingIsJudged) {
  const SceneEffects e = WeighEffects(Pendulum(0.02, 1e-6, 1e-4), {}, {});
  for (const EffectChange& c : e.effects) EXPECT_EQ(c.verdict, EffectVerdict::kUnjudged);
  EXPECT_TRUE(e.set.empty());
}

// A run whose own error is larger than what is asked for cannot tell.
TEST_F(EffectsTest, ALooseRunCannotTell) {
  SceneEffectsOptions options;
  options.sigma = 1e-9;
  options.rtol = 1e-3;
  const SceneEffects e = WeighEffects(Pendulum(0.02, 1e-12, 1e-12), {}, options);
  EXPECT_GT(e.floor, options.part * options.sigma);
  EXPECT_EQ(Of(e, "quadratic dampers of the joints").verdict, EffectVerdict::kCannotTell);
  EXPECT_EQ(Of(e, "gravity").verdict, EffectVerdict::kNeeded);
}

TEST_F(EffectsTest, PartsForThemselvesAndWhatIsAbsent) {
  const std::string scene =
      Put("beams.toml",
          "[scene]\nname = \"beams\"\nduration = 0.2\n"
          "[beam.a]\nlength = 1.0\nmass = 0.5\nEI = 50.0\nEA = 1e5\nsegments = 4\ndamping = 1e-4\n"
          "[beam.b]\nlength = 0.5\nmass = 0.2\nEI = 50.0\nEA = 1e5\nmodel = \"kirchhoff\"\n"
          "order = 2\n"
          "[joint.one]\ninner = \"ground\"\nouter = \"a.start\"\n"
          "[joint.two]\ninner = \"a.end\"\nouter = \"b.start\"\ntheta = 0.3\n"
          "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = \"b.end\"\n");
  SceneEffectsOptions options;
  options.each = true;
  std::vector<std::string> there, absent;
  for (const EffectChange& c : WeighEffects(scene, {}, options).effects) {
    (c.effect.there ? there : absent).push_back(c.effect.name);
    EXPECT_EQ(c.message, "") << c.effect.name;
    EXPECT_GT(c.rms, 0.0) << c.effect.name;
  }
  EXPECT_THAT(there, ElementsAre("gravity", "damping of the beams (a)", "bending of the beams (a)",
                                 "bending of the beams (b)"));
  EXPECT_THAT(absent,
              ElementsAre("stretching of the beams (a)", "a finer mesh (a)", "smooth beams (a)",
                          "stretching of the beams (b)", "a finer mesh (b)"));
}

TEST_F(EffectsTest, BadInputIsNamed) {
  auto message = [](auto&& f) {
    try {
      f();
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string("none");
  };
  SceneEffectsOptions options;
  options.sigma = -1.0;
  EXPECT_THAT(message([&] { WeighEffects(Pendulum(1, 1, 1), {}, options); }), HasSubstr("--sigma"));
  const std::string blind = Put("blind.toml",
                                "[scene]\nname = \"s\"\nduration = 1.0\n[body.a]\nmass = 1.0\n"
                                "inertia = 1.0\n[joint.j]\ninner = \"ground\"\nouter = \"a\"\n");
  EXPECT_THAT(message([&] { WeighEffects(blind, {}, {}); }), HasSubstr("no marks"));
  TrialEffectsOptions of_trial;
  of_trial.budget = 0.0;
  EXPECT_THAT(message([&] { of_trial.Check(); }), HasSubstr("--budget"));
  of_trial.part = -1.0;
  EXPECT_THAT(message([&] { of_trial.Check(); }), HasSubstr("--part"));
  EXPECT_THAT(message([&] { WeighEffects(Pendulum(1, 1, 1), {"joint.hinge.dampr="}, {}); }),
              HasSubstr("did you mean 'damper'"));
}

// A trial of the pendulum's angle with planted damping, linear and quadratic, and what is said of
// each when the study's scene has both.
class TrialEffectsTest : public EffectsTest {
 protected:
  static constexpr double kSigma = 1e-3;  // of a reading [rad]

  // The angle at the record's times [s].
  Eigen::VectorXd Angle(double damping, double quadratic) const {
    SceneModelOptions options;
    options.scene = Pendulum(damping, quadratic, 1e-9);
    options.rtol = 1e-10;
    const SceneModel model(options, {});
    correlate::Stamps stamps;
    stamps.quantities.push_back({"a", "hinge.theta", Times()});
    return model.Evaluate({}, stamps).quantities[0].values;
  }
  static std::vector<double> Times() {
    std::vector<double> out;
    for (double t = 0.0; t < 5.8; t += 0.01) out.push_back(t);
    return out;
  }
  // What was read.
  Eigen::VectorXd Record(double damping, double quadratic, std::uint64_t seed) const {
    Eigen::VectorXd angle = Angle(damping, quadratic);
    const std::vector<double> times = Times();
    Rng rng(seed);
    std::string text = "t [s],angle [rad]\n";
    for (Eigen::Index i = 0; i < angle.size(); ++i) {
      angle(i) += kSigma * rng.Normal();
      text += fmt::format("{:.4f},{:.9f}\n", times[static_cast<std::size_t>(i)], angle(i));
    }
    Put("angle.csv", text);
    return angle;
  }
  TrialEffects Weigh(double damping, double quadratic, const std::string& clock = "0.0",
                     bool both = true) const {
    Pendulum(damping, quadratic, 1e-9);
    const std::string linear =
        "[parameter.damping]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.02\n"
        "bounds = [0.0, 0.2]\n";
    const std::string study =
        Put("study.toml",
            "[study]\nscene = \"pendulum.toml\"\n[trial]\noffset = " + clock +
                "\n[trial.channel.angle]\nfile = \"angle.csv\"\nquantity = \"hinge.theta\"\n"
                "sigma = 1e-3\n" +
                (both ? linear : "") +
                "[parameter.quadratic]\nkeys = [\"joint.hinge.quadratic_damper.damping\"]\n"
                "start = 0.02\nbounds = [0.0, 0.2]\n");
    return WeighTrialEffects(data::ReadStudy(study), {});
  }
  static const TrialEffect& Of(const TrialEffects& e, const std::string& name) {
    for (const TrialEffect& c : e.effects) {
      if (c.effect.name == name) return c;
    }
    throw Error("there is no effect " + name, "test", "");
  }
};

TEST_F(TrialEffectsTest, WhatTheTrialShowsIsNeededWhateverTheOthersImitate) {
  Record(0.02, 0.01, 3);
  const TrialEffects e = Weigh(0.02, 0.01);
  const TrialEffect& linear = Of(e, "dampers of the joints");
  const TrialEffect& quadratic = Of(e, "quadratic dampers of the joints");
  EXPECT_EQ(linear.verdict, EffectVerdict::kNeeded);
  EXPECT_EQ(quadratic.verdict, EffectVerdict::kNeeded);
  EXPECT_THAT(linear.released, ElementsAre("damping"));
  // What is left takes over what it can: the other law's damping rises by many standard errors.
  ASSERT_EQ(linear.shifts.size(), 1U);
  EXPECT_EQ(linear.shifts[0].name, "quadratic");
  EXPECT_GT(linear.shifts[0].sigmas, 10.0);
  EXPECT_EQ(Of(e, "gravity").verdict, EffectVerdict::kNeeded);
  const TrialEffect& springs = Of(e, "springs of the joints");
  EXPECT_EQ(springs.verdict, EffectVerdict::kNotNeeded);
  // Held-out stretches say the same: with what is there they are predicted better, by far.
  EXPECT_GT(linear.held_out.gain, 3.0 * linear.held_out.sigma);
  EXPECT_EQ(linear.held_out.stretches, 8);
  EXPECT_LT(std::abs(springs.held_out.gain), 1.0);
  EXPECT_TRUE(springs.settled);
  // At less than a fit each, but for what sizes are sought of.
  for (const TrialEffect& one : e.effects) {
    if (!one.unit.empty()) continue;
    EXPECT_LE(one.runs, e.fit.result.evaluations.size()) << one.effect.name;
  }
  EXPECT_THAT(e.left_out, ElementsAre("springs of the joints"));
}

// Without gravity the pendulum rests, and a clock of which nothing is known may leave the record:
// where nothing is compared, nothing is "not needed".
TEST_F(TrialEffectsTest, WhatLeavesNothingToCompareIsNeeded) {
  Record(0.02, 0.01, 3);
  const TrialEffects e = Weigh(0.02, 0.01, "\"free\"");
  EXPECT_EQ(Of(e, "gravity").verdict, EffectVerdict::kNeeded);
  for (const std::string& name : e.left_out) EXPECT_NE(name, "gravity");
}

// Without its only parameter a study has nothing left to fit, and here no clock either: the model
// is what it is, and is held against the record all the same.
TEST_F(TrialEffectsTest, WhatTakesTheOnlyParameterIsJudged) {
  const Eigen::VectorXd read = Record(0.02, 0.01, 4);
  const TrialEffects e = Weigh(0.02, 0.01, "0.0", false);
  const TrialEffect& quadratic = Of(e, "quadratic dampers of the joints");
  EXPECT_EQ(quadratic.verdict, EffectVerdict::kNeeded) << quadratic.message;
  EXPECT_TRUE(quadratic.settled);
  EXPECT_THAT(quadratic.released, ElementsAre("quadratic"));
  EXPECT_TRUE(quadratic.shifts.empty());
  const double value = e.fit.record.parameters[0].value;
  const double without = (read - Angle(0.02, 1e-15)).squaredNorm();
  const double with = (read - Angle(0.02, value)).squaredNorm();
  // Both in the noise that the fit is left with, where that is more than is stated.
  const double noise = std::max(kSigma * kSigma, with / static_cast<double>(read.size()));
  EXPECT_NEAR(quadratic.deviance, (without - with) / noise, 0.01 * quadratic.deviance);
  EXPECT_GT(quadratic.held_out.gain, 3.0 * quadratic.held_out.sigma);
  EXPECT_EQ(quadratic.held_out.stretches, 8);

  Record(0.02, 1e-12, 4);
  const TrialEffects none = Weigh(0.02, 1e-4, "0.0", false);
  const TrialEffect& absent = Of(none, "quadratic dampers of the joints");
  EXPECT_NE(absent.verdict, EffectVerdict::kNeeded);
  EXPECT_NE(absent.verdict, EffectVerdict::kFailed) << absent.message;
  EXPECT_LT(absent.probability, 0.5);
}

// Without a trace of it in the trial an effect is never called needed.
TEST_F(TrialEffectsTest, WhatIsNotInTheTrialIsNotNeeded) {
  int needed = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Record(0.02, 1e-12, seed);
    const TrialEffects e = Weigh(0.02, 1e-4);
    const TrialEffect& quadratic = Of(e, "quadratic dampers of the joints");
    needed += quadratic.verdict == EffectVerdict::kNeeded ? 1 : 0;
    EXPECT_EQ(Of(e, "dampers of the joints").verdict, EffectVerdict::kNeeded);
    EXPECT_LT(quadratic.probability, 0.99);
  }
  EXPECT_EQ(needed, 0);
}

}  // namespace
}  // namespace unfurl::study::effects_test
