#include "sim/implicit/modes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scenes.h"
#include "sim/implicit/equilibrium.h"

namespace unfurl::sim::modes_test {
namespace {

ModesReport ModesOf(const Model& model, int count, ModesSolver solver = ModesSolver::kAuto) {
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const EquilibriumReport report = FindEquilibrium(&dynamics, y.data());
  EXPECT_TRUE(report.found) << report.iterations << " " << report.acceleration;
  return FindModes(&dynamics, y.data(), count, solver);
}

// Rounding of a frequency: half of that of omega^2, some 1e-16 of the stiffest over the softest.
constexpr double kRounding = 1e-9;

TEST(Modes, PendulumHangsAndSwings) {
  const double r = 0.5, inertia = 0.1, mass = 2.0, g = 9.81;
  const ModesReport report = ModesOf(ModelFrom(PendulumScene(2.0, r, inertia)), 3);
  ASSERT_EQ(report.modes.size(), 1u);
  EXPECT_EQ(report.rigid, 0);
  const double omega = std::sqrt(mass * g * r / (inertia + mass * r * r));
  EXPECT_NEAR(2.0 * M_PI * report.modes[0].frequency, omega, kRounding * omega);
}

// A bar that turns about a point `r` from its centre: the largest displacement is 1 and the angle 1
// / r, down to displacements that only rounding makes; then the angle is 1.
TEST(Modes, ShapesAreScaledByTheirLargestDisplacement) {
  for (const double r : {0.5, 1e-7, 0.0}) {
    const ModesReport report = ModesOf(
        ModelFrom(fmt::format(
            "[scene]\nname = 'wheel'\nduration = 1.0\n[body.bar]\nmass = 2.0\ninertia = 0.1\n"
            "[joint.pivot]\ninner = 'ground'\nouter = 'bar'\nouter_point = [{}, 0.0]\n"
            "[joint.pivot.spring]\nstiffness = 5.0\npreload = 0.0\n",
            -r)),
        1);
    ASSERT_EQ(report.modes.size(), 1u);
    EXPECT_NEAR(2.0 * M_PI * report.modes[0].frequency, std::sqrt(5.0 / (0.1 + 2.0 * r * r)), 1e-8);
    const std::vector<double>& shape = report.modes[0].shape;
    const std::size_t n = shape.size() / 3;
    double moved = 0.0, turned = 0.0;
    for (std::size_t k = 0; k < shape.size(); ++k) {
      double& largest = k < 2 * n ? moved : turned;
      largest = std::max(largest, std::fabs(shape[k]));
    }
    EXPECT_NEAR(moved, r > 0.0 ? 1.0 : 0.0, 1e-12);
    EXPECT_NEAR(turned, r > 0.0 ? 1.0 / r : 1.0, 1e-6 * turned);
  }
}

TEST(Modes, UprightPendulumFalls) {
  const double r = 0.5, inertia = 0.1, mass = 2.0, g = 9.81;
  const Model model = ModelFrom(PendulumScene(M_PI, r, inertia));
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const ModesReport report = FindModes(&dynamics, y.data(), 3);
  ASSERT_EQ(report.modes.size(), 1u);
  EXPECT_EQ(report.modes[0].frequency, 0.0);
  EXPECT_NEAR(report.modes[0].growth, std::sqrt(mass * g * r / (inertia + mass * r * r)), 1e-8);
}

// Two bars on springs, one on the other: the roots of the 2 x 2 problem by hand. With both pivots
// in one place and the centres there too, angles are the coordinates: I1, I2 with k1, k2 in series.
TEST(Modes, TwoDisksOnSprings) {
  const double I1 = 0.3, I2 = 0.2, k1 = 5.0, k2 = 3.0;
  const Model model = ModelFrom(
      "[scene]\nname = \"disks\"\nduration = 1.0\n"
      "[body.a]\nmass = 1.0\ninertia = 0.3\n[body.b]\nmass = 1.0\ninertia = 0.2\n"
      "[joint.one]\ninner = \"ground\"\nouter = \"a\"\ntheta = 0.4\n"
      "[joint.one.spring]\nstiffness = 5.0\npreload = 0.0\n"
      "[joint.two]\ninner = \"a\"\nouter = \"b\"\ntheta = -0.7\n"
      "[joint.two.spring]\nstiffness = 3.0\npreload = 0.0\n");
  const ModesReport report = ModesOf(model, 3);
  ASSERT_EQ(report.modes.size(), 2u);
  const double p = (k1 + k2) / I1 + k2 / I2, q = k1 * k2 / (I1 * I2);
  for (int k = 0; k < 2; ++k) {
    const double root = std::sqrt(0.5 * (p + (k == 0 ? -1.0 : 1.0) * std::sqrt(p * p - 4.0 * q)));
    EXPECT_NEAR(2.0 * M_PI * report.modes[k].frequency, root, kRounding * root);
  }
}

// Euler-Bernoulli's beta L. The order in n from both sides: higher terms are a few (l k)^2, below
// 0.05 here.
void ExpectSecondOrder(const std::string& scene12, const std::string& scene24,
                       const std::string& scene48, const double* roots, int rigid, double low) {
  constexpr double kHigh = 2.07;
  const double scale = std::sqrt(10.0);  // sqrt(EI / (rho A)) of a 1 m, 1 kg beam
  double error[3][3];
  int k = 0;
  for (const std::string& text : {scene12, scene24, scene48}) {
    const ModesReport report = ModesOf(ModelFrom(text), 3);
    EXPECT_EQ(report.rigid, rigid);
    for (int mode = 0; mode < 3; ++mode) {
      const double exact = roots[mode] * roots[mode] * scale;
      error[k][mode] = 2.0 * M_PI * report.modes.at(mode).frequency / exact - 1.0;
    }
    ++k;
  }
  for (int mode = 0; mode < 3; ++mode) {
    for (int i = 0; i < 2; ++i) {
      const double order = std::log2(error[i][mode] / error[i + 1][mode]);
      EXPECT_GT(order, low) << mode;
      EXPECT_LT(order, kHigh) << mode;
    }
  }
}

TEST(Modes, CantileverAndFreeBeamAreOfSecondOrder) {
  const double cantilever[] = {1.87510406871196, 4.69409113297418, 7.85475743823761};
  const double free_free[] = {4.73004074486270, 7.85320462409584, 10.9956078380017};
  for (const bool clamped : {true, false}) {
    const char* ends = clamped ? "clamped" : "free";
    ExpectSecondOrder(BeamScene(ends, 12), BeamScene(ends, 24), BeamScene(ends, 48),
                      clamped ? cantilever : free_free, clamped ? 0 : 3, 1.93);
  }
}

// Kelvin-Voigt: the ratio of every mode is beta omega / 2.
TEST(Modes, MaterialDampingGivesRatiosByFrequency) {
  constexpr double kBeta = 1e-4;
  const ModesReport report = ModesOf(ModelFrom(BeamScene("clamped", 10, "damping = 1e-4\n")), 5);
  ASSERT_EQ(report.modes.size(), 5u);
  for (const NaturalMode& mode : report.modes) {
    const double expected = 0.5 * kBeta * 2.0 * M_PI * mode.frequency;
    EXPECT_NEAR(mode.damping, expected, 1e-6 * expected);
  }
}

// So many wheels on springs of their own, k = 50 + number in the list, inertia 1 / 2.
std::string WheelsScene(int count, const std::string& springs_of_the_first) {
  std::string text = "[scene]\nname = 'wheels'\nduration = 1.0\n";
  for (int k = 0; k < count; ++k) {
    text += fmt::format(
        "[body.w{0}]\nmass = 1.0\ninertia = 0.5\n[joint.j{0}]\ninner = 'ground'\n"
        "inner_point = [{0}.0, 0.0]\nouter = 'w{0}'\n",
        k);
    if (k > 1) text += fmt::format("[joint.j{0}.spring]\nstiffness = {1}.0\n", k, 50 + k);
  }
  return text + springs_of_the_first;
}

// Wheels that tables push away grow by sqrt(k / I), however much faster than the softest of the
// others swings.
TEST(Modes, WhatGrowsFastIsFoundBySubspacesToo) {
  const std::string pushed =
      "[joint.j0.table]\ntheta = [-1.0, 1.0]\nmoment = [-5000.0, 5000.0]\n"
      "[joint.j1.table]\ntheta = [-1.0, 1.0]\nmoment = [-8.0, 8.0]\n";
  const Model model = ModelFrom(WheelsScene(40, pushed));
  for (const ModesSolver solver : {ModesSolver::kDense, ModesSolver::kSubspace}) {
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    const ModesReport report = FindModes(&dynamics, y.data(), 6, solver);
    EXPECT_EQ(report.rigid, 0);
    ASSERT_EQ(report.modes.size(), 6u);
    EXPECT_NEAR(report.modes[0].growth, 100.0, 1e-6);
    EXPECT_NEAR(report.modes[1].growth, 4.0, 1e-6);
    for (int k = 2; k < 6; ++k) {
      EXPECT_NEAR(report.modes[k].frequency, std::sqrt(2.0 * (50 + k)) / (2.0 * M_PI), 1e-8);
    }
  }
}

// Two wheels on springs among many bodies that nothing holds: three rigid motions each, more than
// the modes asked for.
TEST(Modes, OfManyFreeBodies) {
  constexpr int kFree = 60;
  std::string text = WheelsScene(4, "");
  for (int k = 0; k < kFree; ++k) {
    text += fmt::format("[body.f{0}]\nmass = 1.0\ninertia = 0.5\npose = [{0}.0, 5.0, 0.0]\n", k);
  }
  const Model model = ModelFrom(text);
  for (const ModesSolver solver : {ModesSolver::kDense, ModesSolver::kSubspace}) {
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    const ModesReport report = FindModes(&dynamics, y.data(), 3, solver);
    EXPECT_EQ(report.rigid, 3 * kFree + 2);
    ASSERT_EQ(report.modes.size(), 2u);
    for (int k = 0; k < 2; ++k) {
      EXPECT_NEAR(report.modes[k].frequency, std::sqrt(2.0 * (52 + k)) / (2.0 * M_PI), 1e-8);
    }
  }
}

// Two algorithms on the latched deployment: dense on the null space, and subspace iteration.
TEST(Modes, BothSolversAgreeOnTheLatchedDeployment) {
  data::Scene scene = data::ReadScene(DeploymentPath("clearance"));
  for (auto& joint : scene.joints) joint.theta = -joint.latch->theta_b;
  const Model model = Compile(scene);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const EquilibriumReport report = FindLatchedEquilibrium(&dynamics, y.data());
  ASSERT_TRUE(report.found) << report.iterations << " " << report.acceleration;
  // Each spring is carried by its contact: K delta^1.5 x_p = K_t (preload - theta_b).
  const Motion motion = dynamics.MotionAt(0.0, y.data());
  for (int k = 0; k < model.latches.count(); ++k) {
    EXPECT_EQ(dynamics.modes()[k].lower_contact, 1);
    const double theta = model.latches.hinge(k).Theta(motion);
    const double moment = model.latches.Moment(k, motion, dynamics.modes()[k]);
    EXPECT_NEAR(moment, 0.218 * (theta + 1.57), 1e-8);
  }
  const ModesReport a = FindModes(&dynamics, y.data(), 10, ModesSolver::kDense);
  const ModesReport b = FindModes(&dynamics, y.data(), 10, ModesSolver::kSubspace);
  EXPECT_EQ(a.rigid, 3);
  EXPECT_EQ(b.rigid, 3);
  ASSERT_EQ(b.modes.size(), 10u);
  for (int k = 0; k < 10; ++k) {
    EXPECT_NEAR(a.modes[k].frequency, b.modes[k].frequency, 1e-6 * a.modes[k].frequency) << k;
    EXPECT_GT(a.modes[k].damping, 0.0);  // of the contacts
  }
}

// Rounding hides little of smooth motions, however fine the mesh: free beams of up to 2048 segments
// (closed forms), and two beams on a free hub with a spring
// between them that is 1e7 times as stiff as they are. Of the stiffest omega^2 the softest ones are
// 1e-13 and 1e-16.
TEST(Modes, OfFineMeshesAreNotTakenForRigidOnes) {
  const double squares[] = {22.37328545, 61.67282287, 120.90339169};
  for (const int segments : {256, 2048}) {
    const ModesReport report = ModesOf(
        ModelFrom(fmt::format("[scene]\nname = 'free'\nduration = 1.0\n[beam.rod]\nlength = 3.0\n"
                              "mass = 2.0\nEI = 4.0\nsegments = {}\n",
                              segments)),
        3);
    EXPECT_EQ(report.rigid, 3);
    ASSERT_EQ(report.modes.size(), 3u);
    for (int k = 0; k < 3; ++k) {
      const double exact = squares[k] / 9.0 * std::sqrt(4.0 / (2.0 / 3.0)) / (2.0 * M_PI);
      EXPECT_NEAR(report.modes[k].frequency, exact, 30.0 / (segments * segments) * exact) << k;
    }
  }
  std::vector<ModesReport> reports;
  for (const int segments : {60, 256}) {
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = 'turned'\nduration = 1.0\n[body.hub]\nmass = 5.0\ninertia = 0.3\n"
        "pose = [3.0, -2.0, 0.7]\n"
        "[beam.one]\nlength = 3.0\nmass = 2.0\nEI = 4.0\nsegments = {0}\n"
        "[beam.two]\nlength = 1.0\nmass = 0.2\nEI = 0.5\nsegments = {0}\n"
        "[joint.a]\ninner = 'hub'\nouter = 'one.start'\ntheta = 0.33\n"
        "[joint.a.spring]\nstiffness = 30.0\npreload = 0.33\n"
        "[joint.b]\ninner = 'one.end'\nouter = 'two.start'\ntheta = -0.9\n"
        "[joint.b.spring]\nstiffness = 1e7\npreload = -0.9\n",
        segments));
    Dynamics dynamics(model);
    std::vector<double> y = model.initial_state;
    reports.push_back(FindModes(&dynamics, y.data(), 3));
    EXPECT_EQ(reports.back().rigid, 3);
    ASSERT_EQ(reports.back().modes.size(), 3u);
  }
  for (int k = 0; k < 3; ++k) {
    const double fine = reports[1].modes[k].frequency;
    EXPECT_NEAR(reports[0].modes[k].frequency, fine, 5.0 / (60.0 * 60.0) * fine) << k;
  }
}

}  // namespace
}  // namespace unfurl::sim::modes_test
