#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "base/error.h"
#include "scenes.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::compile_test {
namespace {

using ::testing::HasSubstr;

void ExpectRefused(const std::string& toml, const std::vector<std::string>& words) {
  try {
    ModelFrom(toml);
    FAIL() << "was taken: " << toml;
  } catch (const Error& error) {
    for (const std::string& word : words) EXPECT_THAT(error.what(), HasSubstr(word));
    EXPECT_EQ(error.kind(), ErrorKind::kBadInput);
  }
}

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

// Links of 1 m between (0, 0) and (`base`, 0): three bars in a row, the last one pinned to ground.
std::string FourBar(double base, double crank_angle = 1.5707963267948966) {
  std::string text = "[scene]\nname = \"four bars\"\nduration = 1.0\n";
  for (const char* name : {"crank", "coupler", "rocker"}) {
    text += fmt::format("[body.{}]\nmass = 1.0\ninertia = 0.1\n", name);
  }
  const std::string points = "inner_point = [0.5, 0.0]\nouter_point = [-0.5, 0.0]\n";
  text += fmt::format(
      "[joint.a]\ninner = \"ground\"\nouter = \"crank\"\nouter_point = [-0.5, 0.0]\ntheta = {}\n",
      crank_angle);
  text += "[joint.b]\ninner = \"crank\"\nouter = \"coupler\"\n" + points + "theta = -1.4\n";
  text += "[joint.c]\ninner = \"coupler\"\nouter = \"rocker\"\n" + points + "theta = -1.5\n";
  text += fmt::format(
      "[joint.d]\ninner = \"rocker\"\ninner_point = [0.5, 0.0]\nouter = \"ground\"\n"
      "outer_point = [{}, 0.0]\n",
      base);
  return text;
}

TEST(Compile, DeploymentIsPlacedAsDescribed) {
  const Model model = Compile(data::ReadScene(DeploymentPath("suspension")));
  // Hub with two root halves, six other halves, four beams of eight segments.
  EXPECT_EQ(model.DynamicBodies(), 1 + 6 + 32);
  EXPECT_EQ(model.bending.count(), 4 * 7 + 6);
  EXPECT_EQ(model.constraints.count(), 4 * 7 + 6 + 8);
  EXPECT_EQ(std::get<JointEffect<Spring>>(model.joint_effects).count(), 4);
  Observables observables(model);
  std::vector<double> y = model.initial_state;
  const std::vector<double> row = observables.Row(0.0, y.data(), model.initial_modes);
  const auto value = [&](const std::string& name) {
    for (std::size_t q = 0; q < observables.quantities().size(); ++q) {
      if (observables.quantities()[q].name == name) return row[q];
    }
    ADD_FAILURE() << name;
    return 0.0;
  };
  constexpr double kTolerance = 1e-12;  // rounding
  // Folded: root beams stand upwards from the pins at +-0.18, outer beams come back down.
  EXPECT_NEAR(value("joint1.x"), 0.18, kTolerance);
  EXPECT_NEAR(value("joint1.y"), 0.0, kTolerance);
  EXPECT_NEAR(value("joint2.x"), 0.18, kTolerance);
  EXPECT_NEAR(value("joint2.y"), 0.84, kTolerance);
  EXPECT_NEAR(value("joint4.x"), -0.18, kTolerance);
  EXPECT_NEAR(value("mark3.x"), 0.18, kTolerance);
  EXPECT_NEAR(value("mark3.y"), 0.84 - 0.82, kTolerance);
  EXPECT_NEAR(value("beam4.x"), -0.18, kTolerance);
  EXPECT_NEAR(value("beam4.y"), 0.84 - 0.02 - 0.4, kTolerance);
  EXPECT_NEAR(value("mark1.x"), -0.16, kTolerance);
  EXPECT_NEAR(value("mark1b.x"), 0.16, kTolerance);
  for (const char* joint : {"joint1", "joint3"}) {
    EXPECT_NEAR(value(std::string(joint) + ".theta"), M_PI_2, kTolerance);
    EXPECT_NEAR(value(std::string(joint) + ".spring_moment"), -0.218 * (M_PI_2 + 1.57), kTolerance);
  }
  for (const char* joint : {"joint2", "joint4"}) {
    EXPECT_NEAR(value(std::string(joint) + ".theta"), M_PI, kTolerance);
  }
  EXPECT_NEAR(value("energy.bending"), 0.0, kTolerance);
  EXPECT_NEAR(value("constraint.position"), 0.0, kTolerance);
  // All mass: 36 + 4 x 0.306 + 3 x 0.424 + 0.382; its centre from the folded places.
  double centre = 0.0;
  for (const auto& [m, y_at] : {std::pair{0.306 / 2, 0.01},
                                {0.306 / 2, 0.83},
                                {0.306 / 2, 0.83},
                                {0.424, 0.42},
                                {0.424, 0.42}}) {
    centre += m * y_at;  // right arm
  }
  for (const auto& [m, y_at] : {std::pair{0.306 / 2, 0.01},
                                {0.306 / 2, 0.83},
                                {0.306 / 2, 0.83},
                                {0.424, 0.42},
                                {0.382, 0.42}}) {
    centre += m * y_at;  // left arm
  }
  EXPECT_NEAR(value("centre.y"), centre / (36 + 4 * 0.306 + 3 * 0.424 + 0.382), kTolerance);
}

TEST(Compile, WhatIsNotInTheSceneHasNoInstances) {
  const Model model = ModelFrom(PendulumScene(0.5));
  for (const Model::EffectCount& effect : model.Effects()) {
    EXPECT_TRUE(effect.name == "bodies" || effect.name == "gravity" || effect.name == "constraints")
        << effect.name;
    EXPECT_EQ(effect.count, effect.name == "constraints" ? 2 : 1);
  }
}

TEST(Compile, ClosesLoops) {
  const Model model = ModelFrom(FourBar(1.2));
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  EXPECT_LT(dynamics.PositionDrift(0.0, y.data()), 1e-10);
  EXPECT_EQ(model.constraints.count(), 8);
}

TEST(Compile, RefusesALoopThatCannotClose) {
  ExpectRefused(FourBar(3.5), {"cannot close", "'a'", "'b'", "'c'", "'d'", "test.toml:"});
}

TEST(Compile, LeavesOutRedundantConstraintsWithAWarning) {
  // A second pin at the same place repeats the first.
  const std::string text = PendulumScene(0.5) +
                           "[joint.again]\ninner = \"ground\"\nouter = \"bar\"\n"
                           "outer_point = [-0.5, 0.0]\nzero_angle = -1.5707963267948966\n";
  const Model model = ModelFrom(text);
  EXPECT_EQ(model.constraints.count(), 2);
  ASSERT_EQ(model.warnings.size(), 1u);
  const bool named = model.warnings[0].find("'again'") != std::string::npos ||
                     model.warnings[0].find("'pivot'") != std::string::npos;
  EXPECT_TRUE(named) << model.warnings[0];
}

TEST(Compile, RefusesDrivesThatFight) {
  // One degree of freedom: a second drive repeats what the first already says, or contradicts it.
  ExpectRefused(FourBar(1.0) +
                    "theta = 1.5707963267948966\n[joint.a.drive]\nrate = 1.0\n"
                    "[joint.d.drive]\nrate = 2.0\n",
                {"the drives of", "'a'", "'d'", "conflict with other"});
  ExpectRefused(
      FourBar(1.2) +
          "[joint.a.drive]\nposition = '1.5707963267948966 + t'\n[joint.d.drive]\nposition = 0.1\n",
      {"cannot close", "the drives of", "'a'", "'d'", "may conflict"});
}

TEST(Compile, RefusesWhatDoesNotFit) {
  const std::string latching = LatchingBarScene();
  ExpectRefused(Replaced(latching, "mass = 0.5", "mass = -0.5"), {"body.bar.mass", "test.toml:"});
  ExpectRefused(Replaced(latching, "mass = 0.5", "mass = 0.0"), {"body.bar.mass"});
  ExpectRefused(Replaced(latching, "mass = 0.5", "mass = nan"), {"body.bar.mass"});
  ExpectRefused(Replaced(latching, "mass = 0.5", "mas = 0.5"), {"body.bar"});
  ExpectRefused(Replaced(latching, "inertia = 0.02", "inertia = 0.02\ninertai = 1.0"),
                {"inertai", "inertia"});
  ExpectRefused(Replaced(latching, "theta_b = 0.0052", "theta_b = -0.006"),
                {"theta_a + theta_b", "joint.hinge.latch.theta_b"});
  ExpectRefused(Replaced(latching, "contact = \"lock\"", "contact = \"lokc\""), {"lokc", "lock"});
  ExpectRefused(Replaced(latching, "outer = \"bar\"", "outer = \"bra\""), {"bra", "bar"});
  ExpectRefused(Replaced(latching, "[mark.tip]\non = \"bar\"", "[mark.tip]\non = \"beam1.end\""),
                {"beam1.end", "mark.tip.on"});
  ExpectRefused(Replaced(latching, "stiffness = 0.218", "stiffness = 0"), {"spring.stiffness"});
  ExpectRefused(Replaced(latching, "lever = 0.02", "lever = inf"), {"latch.lever"});
  ExpectRefused(Replaced(latching, "duration = 2.0", "duration = 0.0"), {"scene.duration"});
  const std::string beam = BeamScene("clamped", 4);
  ExpectRefused(Replaced(beam, "segments = 4", "segments = 0"), {"beam.rod.segments"});
  ExpectRefused(Replaced(beam, "length = 1.0", "length = 0.0"), {"beam.rod.length"});
  ExpectRefused(Replaced(beam, "EI = 10.0", "EI = -10.0"), {"beam.rod.EI"});
  ExpectRefused(Replaced(beam, "EI = 10.0", "EI = 10.0\naxial = \"elastic\""), {"EA"});
  ExpectRefused(Replaced(beam, "EI = 10.0", "EI = 10.0\naxial = \"elsatic\""), {"axial"});
  ExpectRefused(beam + "[weld.second]\ninner = \"ground\"\nouter = \"rod.start\"\n",
                {"second", "root"});
  ExpectRefused(Replaced(beam, "EI = 10.0", "EI = 10.0\npose = [0.0, 0.0, 0.0]"), {"rod"});
  ExpectRefused(beam +
                    "[joint.end]\ninner = \"ground\"\ninner_point = [1.0, 0.0]\n"
                    "outer = \"rod.end\"\n[joint.end.spring]\nstiffness = 1.0\n",
                {"end"});
  ExpectRefused("[scene]\nname = \"x\"\nduration = 1.0\n", {"neither bodies nor beams"});
  ExpectRefused(latching + "[body.tip]\nmass = 1.0\ninertia = 1.0\n", {"already taken"});
}

// A driven bar whose inertia is 1e-12 of m r^2: nothing duplicates anything.
TEST(Compile, RefusesBodiesWithNextToNoInertia) {
  ExpectRefused(
      "[scene]\nname = \"light\"\nduration = 1.0\n"
      "[body.bar]\nmass = 1e-6\ninertia = 1e-16\n[joint.pin]\ninner = \"ground\"\n"
      "outer = \"bar\"\nouter_point = [-10.0, 0.0]\n[joint.pin.drive]\nrate = 1.0\n",
      {"'pin'", "too little mass or inertia", "give each body"});
}

TEST(Compile, OneSegmentIsLegal) {
  const Model model = ModelFrom(BeamScene("clamped", 1, "damping = 1e-4\n"));
  SimulateOptions options;
  options.duration = 0.1;
  EXPECT_TRUE(Simulate(model, options, nullptr).Usable());
}

TEST(Compile, HundredThousandSegmentsFit) {
  // Time and memory are not asserted here (the bench shows them); that nothing is quadratic is: the
  // Schur factor has one entry per row.
  const Model model = ModelFrom(BeamScene("clamped", 100000));
  EXPECT_EQ(model.constraints.count(), 100000);
  EXPECT_EQ(model.constraints.ldlt().nonzeros(), 99999);
}

TEST(Compile, StartingVelocitiesFollowTheJointRates) {
  std::string text = Replaced(FourBar(1.0), "theta = 1.5707963267948966",
                              "theta = 1.5707963267948966\ntheta_rate = 2.0");
  const Model model = ModelFrom(text);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  EXPECT_LT(dynamics.VelocityDrift(0.0, y.data()), 1e-12);
}

}  // namespace
}  // namespace unfurl::sim::compile_test
