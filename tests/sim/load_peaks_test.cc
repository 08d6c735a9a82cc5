// The largest loads of a run, against closed forms: inside steps, after jumps, in contacts, by
// every method.
#include "sim/methods/load_peaks.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim/methods/simulate.h"
#include "tests/sim/sampled_rows.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::load_peaks_test {
namespace {

// LoadPeaks looks for nothing that is higher by less than a thousandth.
constexpr double kPeakError = 1.5e-3;  // of a load [-]

SimulateReport Judged(const std::string& scene, Method method, double rtol) {
  SimulateOptions options;
  options.method = method;
  options.rtol = rtol;
  options.rate = 10.0;
  SimulateReport report = Simulate(ModelFrom(scene), options, nullptr);
  EXPECT_TRUE(report.Usable()) << report.message;
  return report;
}

// A pendulum falls through its lowest place once: m (g + r omega^2) there. Orders 4, 5 and 8, of
// which the last takes the longest steps.
TEST(LoadPeaks, APendulumsAtItsLowestPlace) {
  constexpr double kStart = 3.1, kMass = 2.0, kRadius = 0.5, kInertia = 0.1, kGravity = 9.81;
  const double square = 2.0 * kMass * kGravity * kRadius * (1.0 - std::cos(kStart)) /
                        (kInertia + kMass * kRadius * kRadius);
  const double largest = kMass * (kGravity + kRadius * square);
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    for (const double rtol : {1e-3, 1e-5, 1e-8, 1e-10}) {
      const SimulateReport report = Judged(PendulumScene(kStart, kRadius, kInertia), method, rtol);
      EXPECT_NEAR(report.peak_pin_force[0], largest, kPeakError * largest)
          << MethodName(method) << " " << rtol;
    }
  }
}

// A bar at rest is struck by a force across it at its centre, which dies away at once: of F the pin
// bears the part that the centre's acceleration, F r^2 / (I + m r^2), leaves.
TEST(LoadPeaks, RightAfterAJump) {
  constexpr double kMass = 2.0, kRadius = 0.5, kInertia = 0.1, kGravity = 9.81, kForce = 400.0;
  const std::string scene =
      PendulumScene(0.0, kRadius, kInertia) +
      "[force.blow]\non = \"bar\"\nforce = [\"400 * step(t - 0.7) * exp(-(t - 0.7) / 1e-3)\", 0]\n";
  const double carried = kMass * kRadius * kRadius / (kInertia + kMass * kRadius * kRadius);
  const double largest = std::hypot(kForce * (1.0 - carried), kMass * kGravity);
  for (const Method method : {Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
    const SimulateReport report = Judged(scene, method, 1e-5);
    EXPECT_NEAR(report.peak_pin_force[0], largest, 1e-6 * largest) << MethodName(method);
    EXPECT_NEAR(report.peak_pin_time[0], 0.7, 1e-9) << MethodName(method);
  }
}

// An arm runs into its stop once: K delta^2.5 / 2.5 is its energy, K delta^1.5 the force.
TEST(LoadPeaks, OfAnImpact) {
  constexpr double kMass = 0.5, kInertia = 0.02, kRadius = 0.3, kLever = 0.02, kK = 5e9,
                   kRate = 1.5;
  const std::string scene =
      "[scene]\nname = \"impact\"\nduration = 0.05\n"
      "[contact.lock]\nlaw = \"hunt_crossley\"\nK = 5e9\nalpha = 1e-9\n"
      "[body.bar]\nmass = 0.5\ninertia = 0.02\n"
      "[joint.hinge]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.3, 0.0]\n"
      "theta = 0.0\ntheta_rate = -1.5\n"
      "[joint.hinge.latch]\ntheta_a = 0.02\ntheta_b = 0.02\nlever = 0.02\ncontact = \"lock\"\n";
  const double inertia = kInertia + kMass * kRadius * kRadius;
  const double depth = std::pow(2.5 * 0.5 * inertia * kRate * kRate / kK, 0.4);
  const double moment = kLever * kK * std::pow(depth, 1.5);
  for (const Method method : {Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
    for (const double rtol : {1e-5, 1e-8}) {
      const SimulateReport report = Judged(scene, method, rtol);
      EXPECT_NEAR(report.peak_moment[0], moment, kPeakError * moment)
          << MethodName(method) << " " << rtol;
      const double force = kMass * kRadius * moment / inertia;  // at rest, most pressed
      EXPECT_NEAR(report.peak_pin_force[0], force, kPeakError * force)
          << MethodName(method) << " " << rtol;
    }
  }
}

// Samples lie between implicit steps, where a cubic through their ends is off by nothing that a
// mark shows, and by twice the largest load in the highest shapes of a smooth beam. No sample is
// beyond the peak that the explicit method finds.
TEST(LoadPeaks, SamplesOfImplicitStepsAreNotBeyondThem) {
  const Model model = ModelFrom(
      "[scene]\nname = \"latched\"\nduration = 1.0\n"
      "[contact.lock]\nK = 5e9\nC = 4000.0\nQ = 3.0\nepsilon = 5e-6\n"
      "[beam.b]\nlength = 1.0\nmass = 0.4\nEI = 50.0\nmodel = \"kirchhoff\"\norder = 8\n"
      "damping = 5e-5\n"
      "[joint.j]\ninner = \"ground\"\nouter = \"b.start\"\ntheta = 0.4\n"
      "[joint.j.spring]\nstiffness = 0.35\npreload = 1.5\n"
      "[joint.j.latch]\ntheta_a = 0.004\ntheta_b = 0.004\nlever = 0.02\ncontact = \"lock\"\n");
  SimulateOptions options;
  options.method = Method::kProjected;
  options.rtol = 1e-5;
  const SimulateReport explicit_report = Simulate(model, options, nullptr);
  ASSERT_TRUE(explicit_report.Usable());
  const double largest = explicit_report.peak_pin_force[0];
  for (const double rtol : {1e-2, 1e-3, 1e-5}) {
    options.method = Method::kImplicit;
    options.rtol = rtol;
    options.rate = 2000.0;
    SampledRows run(model);
    const SimulateReport report = Simulate(model, options, &run);
    ASSERT_TRUE(report.Usable()) << rtol;
    constexpr double kKnown = 0.05;  // to which loads are at 1e-3
    EXPECT_NEAR(report.peak_pin_force[0], largest, kKnown * largest) << rtol;
    double sampled = 0.0;
    for (std::size_t i = 0; i < run.t.size(); ++i) {
      sampled = std::max(sampled, run.At(i, "j.pin_force"));
    }
    EXPECT_LT(sampled, (1.0 + kKnown) * largest) << rtol;
  }
}

// A short pendulum that swings for long by long implicit steps: samples were 0.28% beyond the peak.
TEST(LoadPeaks, InsideImplicitSteps) {
  std::string scene = PendulumScene(3.1, 0.05, 0.001);
  scene.replace(scene.find("5.0"), 3, "15.0");
  const Model model = ModelFrom(scene);
  SimulateOptions options;
  options.method = Method::kImplicit;
  options.rtol = 1e-3;
  options.rate = 1000.0;
  SampledRows run(model);
  const SimulateReport report = Simulate(model, options, &run);
  double sampled = 0.0;
  for (std::size_t i = 0; i < run.t.size(); ++i) {
    sampled = std::max(sampled, run.At(i, "pivot.pin_force"));
  }
  EXPECT_LT(sampled, (1.0 + kPeakError) * report.peak_pin_force[0]);
}

// A hub that is turned, with a segmented boom on a spring and a smooth one welded to it. `auto`
// comes from implicit steps to one of order eight near its edge of stability, in the middle of
// which the hub's bearing seemed to bear 69 N: what the interpolation made of stiff shapes.
TEST(LoadPeaks, AreNotReadInsideStepsThatDoNotResolveStiffParts) {
  const Model model = ModelFrom(
      "[scene]\nname = \"hub\"\nduration = 0.433\n"
      "[body.hub]\nmass = 18.133\ninertia = 0.0132\n"
      "[joint.bear]\ninner = \"ground\"\nouter = \"hub\"\n"
      "[joint.bear.drive]\nrate = \"8*smoothstep(t/0.2)\"\n"
      "[beam.b]\nlength = 0.7692264080501\nmass = 0.795\nEI = 6.822\nsegments = 4\n"
      "[joint.j]\ninner = \"hub\"\nouter = \"b.start\"\ntheta = 1.0643\nsign = -1\n"
      "theta_rate = -1.606\n[joint.j.spring]\nstiffness = 0.1145\npreload = 0.772\n"
      "[body.tip]\nmass = 0.304\ninertia = 0.000172\n"
      "[weld.end]\ninner = \"b.end\"\nouter = \"tip\"\nouter_point = [0.066, 0.075]\n"
      "[beam.c]\nlength = 0.464273984064687\nmass = 0.27\nEI = 98.45\nmodel = \"kirchhoff\"\n"
      "order = 3\n[weld.c]\ninner = \"hub\"\nouter = \"c.start\"\nangle = 2.037\n");
  SimulateOptions options;
  const SimulateReport rough = Simulate(model, options, nullptr);
  options.method = Method::kProjected;
  options.rtol = 1e-9;
  const SimulateReport fine = Simulate(model, options, nullptr);
  ASSERT_TRUE(rough.Usable() && fine.Usable());
  constexpr double kKnown = 0.25;  // in what is stiff, at the default tolerance
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    EXPECT_NEAR(rough.peak_pin_force[j], fine.peak_pin_force[j], kKnown * fine.peak_pin_force[j])
        << model.joints[j].name;
  }
}

// What the partitioned method knows of multipliers is what the projected one knows: a beam that is
// stretched beyond what its mesh resolves ends both runs.
TEST(LoadPeaks, AxialForcesByEveryMethod) {
  for (const Method method : {Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
    SimulateOptions options;
    options.method = method;
    const SimulateReport report = Simulate(
        ModelFrom(BeamScene("clamped", 4, "[force.p]\non = \"rod.end\"\nforce = [160.0, 0.0]\n")),
        options, nullptr);
    EXPECT_EQ(report.status, SimulateStatus::kMeshCoarse) << MethodName(method);
    EXPECT_NEAR(report.axial[0].ratio, 160.0 / (16.0 * 10.0), 1e-6) << MethodName(method);
  }
}

}  // namespace
}  // namespace unfurl::sim::load_peaks_test
