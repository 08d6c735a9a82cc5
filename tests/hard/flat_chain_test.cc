// The chain of N four-bars (data/sets/four_bar_chain) through its flat states, in which all its
// constraints of one direction depend on one another and it could fold into another mechanism.
// Success: 10 s with every method, at loose and tight tolerances, the angle of the one equation
// that the chain follows as long as its rods stay parallel.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"
#include "tests/sim/sampled_rows.h"
#include "tests/source_dir.h"
#include "verification/reference.h"

namespace unfurl::sim::flat_chain_test {
namespace {

constexpr double kDuration = 10.0;
// The top of a rod, over the tolerance: some seven crossings, each of which magnifies what the
// constraints are off by. Measured: up to 2e3 (projected) and 2e4 (partitioned).
constexpr double kAllowed = 3e4;

struct Case {
  int n;
  Method method;
  double rtol;
};

class FlatChain : public ::testing::TestWithParam<Case> {};

TEST_P(FlatChain, IsPassed) {
  const Case c = GetParam();
  const Model model =
      Compile(data::ReadScene(std::string(UNFURL_SOURCE_DIR) + "/data/sets/four_bar_chain/scene_" +
                              std::to_string(c.n) + ".toml"));
  ASSERT_FALSE(model.marks.empty());
  SimulateOptions options;
  options.method = c.method;
  options.rtol = c.rtol;
  options.duration = kDuration;
  options.rate = 10.0;
  const MarkTracks tracks = SimulateMarks(model, options);
  ASSERT_TRUE(tracks.report.Usable()) << tracks.report.message;
  EXPECT_GT(tracks.report.near_dependence, 3);
  EXPECT_LT(tracks.report.rejected, tracks.report.steps / 4);

  const double n = c.n, inertia = (n + 1) / 3.0 + n, moment = 9.81 * ((n + 1) / 2.0 + n);
  reference::Integrator integrator;
  const auto states = integrator.Run(
      [&](double, const auto& y, auto& dydt) {
        dydt[0] = y[1];
        dydt[1] = -moment / inertia * std::cos(y[0]);
      },
      {M_PI_2, -1.0}, reference::EvenTimes(kDuration, 100));
  ASSERT_EQ(states.size(), tracks.t.size());
  double worst = 0.0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    worst = std::max(worst, std::hypot(tracks.x[0][k] - std::cos(states[k][0]),
                                       tracks.y[0][k] - std::sin(states[k][0])));
  }
  RecordProperty("error over rtol", std::to_string(worst / c.rtol));
  EXPECT_LT(worst, kAllowed * c.rtol);
}
INSTANTIATE_TEST_SUITE_P(
    All, FlatChain,
    ::testing::Values(Case{2, Method::kProjected, 1e-6}, Case{2, Method::kProjected, 1e-9},
                      Case{2, Method::kPartitioned, 1e-6}, Case{2, Method::kPartitioned, 1e-9},
                      Case{40, Method::kProjected, 1e-7}, Case{40, Method::kPartitioned, 1e-7}));

// At a flat state the rods at the ends want another acceleration than those within, and couplers
// along them give it by no finite force: no pin of the chain has a largest one. That of a pendulum
// beside it does: let go level, m (g + r omega^2) at its lowest place.
TEST(FlatChainLoads, OfTheChainAreNotKnownAndThoseBesideItAre) {
  constexpr double kMass = 2.0, kRadius = 0.5, kInertia = 0.1, kGravity = 9.81;
  const double square = 2.0 * kMass * kGravity * kRadius / (kInertia + kMass * kRadius * kRadius);
  const double largest = kMass * (kGravity + kRadius * square);
  std::ifstream file(std::string(UNFURL_SOURCE_DIR) + "/data/sets/four_bar_chain/scene_2.toml");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  text +=
      "[body.bar]\nmass = 2.0\ninertia = 0.1\n"
      "[joint.pendulum]\ninner = \"ground\"\ninner_point = [0.0, 5.0]\nouter = \"bar\"\n"
      "outer_point = [-0.5, 0.0]\ntheta = 0.0\n";
  const Model model = Compile(data::ParseScene(text, "beside.toml"));
  for (const Method method : {Method::kAuto, Method::kPartitioned, Method::kImplicit}) {
    SimulateOptions options;
    options.method = method;
    options.duration = 2.0;
    const SimulateReport report = Simulate(model, options, nullptr);
    ASSERT_TRUE(report.Usable()) << report.message;
    ASSERT_EQ(report.peak_pin_force.size(), model.joints.size());
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      const bool beside = model.joints[j].name == "pendulum";
      EXPECT_EQ(report.PinForceUnknown(j), !beside) << MethodName(method) << model.joints[j].name;
      if (!beside) continue;
      EXPECT_NEAR(report.peak_pin_force[j], largest, 2e-3 * largest) << MethodName(method);
    }
    ASSERT_FALSE(report.warnings.empty());
    EXPECT_NE(report.warnings.back().find("not known"), std::string::npos);
  }
}

// Three bars of length 1 on a base a little shorter come close to lying flat, and never do: loads
// are large there and are known, no less than what is seen in samples close to one another.
TEST(FlatChainLoads, NearlyFlatAreKnown) {
  constexpr double kBase = 0.99;
  const double half = 0.5 * std::hypot(kBase, 1.0), up = std::sqrt(1.0 - half * half);
  const double x = 0.5 * kBase + up * 0.5 / half, y = 0.5 + up * 0.5 * kBase / half;
  const double coupler = std::atan2(y - 1.0, x), rocker = std::atan2(y, x - kBase);
  std::string text =
      "[scene]\nname = \"nearly flat\"\nduration = 2.0\n[gravity]\nacceleration = [0.0, -9.81]\n";
  for (const char* name : {"crank", "coupler", "rocker"}) {
    text += fmt::format("[body.{}]\nmass = 1.0\ninertia = 0.0833\n", name);
  }
  const auto joint = [&](const char* inner, double at, const char* outer, double to, double theta) {
    text += fmt::format(
        "[joint.{0}_{2}]\ninner = \"{0}\"\ninner_point = [{1}, 0.0]\nouter = \"{2}\"\n"
        "outer_point = [{3}, 0.0]\ntheta = {4}\n",
        inner, at, outer, to, theta);
  };
  joint("ground", 0.0, "crank", -0.5, M_PI_2);
  joint("crank", 0.5, "coupler", -0.5, coupler - M_PI_2);
  joint("ground", kBase, "rocker", -0.5, rocker);
  joint("coupler", 0.5, "rocker", 0.5, rocker - coupler);
  text.replace(text.find("theta = 1.57"), 5, "theta_rate = -4.0\ntheta");
  const Model model = Compile(data::ParseScene(text, "nearly_flat.toml"));
  SimulateOptions options;
  options.rtol = 1e-8;
  options.rate = 2e4;
  SampledRows run(model);
  const SimulateReport report = Simulate(model, options, &run);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_GT(report.near_dependence, 0);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    EXPECT_FALSE(report.PinForceUnknown(j)) << model.joints[j].name;
    double sampled = 0.0;
    for (std::size_t i = 0; i < run.t.size(); ++i) {
      sampled = std::max(sampled, run.At(i, model.joints[j].name + ".pin_force"));
    }
    EXPECT_NEAR(report.peak_pin_force[j], sampled, 2e-3 * sampled) << model.joints[j].name;
  }
}

}  // namespace
}  // namespace unfurl::sim::flat_chain_test
