#include "sim/implicit/find_modes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "base/error.h"
#include "scenes.h"
#include "tests/traps.h"

namespace unfurl::sim::find_modes_test {
namespace {

// Of a clamped beam: the roots of 1 + cos cosh = 0; 16 segments leave (l^2 / 24) int(v v'') /
// int(v^2), 0.03 to 0.7%. Shapes: at the clamp nothing moves, the tip moves most.
TEST(FindModes, OfACantilever) {
  const data::Scene scene = data::ParseScene(BeamScene("clamped", 16), "beam.toml");
  ModesOptions options;
  options.count = 3;
  const SceneModes modes = FindModes(scene, options);
  ASSERT_TRUE(modes.usable);
  ASSERT_EQ(modes.record.modes.size(), 3u);
  EXPECT_EQ(modes.rigid, 0);
  constexpr double kRoots[] = {1.8751040687, 4.6940911330, 7.8547574382};
  constexpr double kLeft[] = {5e-4, 4e-3, 1e-2};
  for (int k = 0; k < 3; ++k) {
    const data::ModesRecord::Mode& mode = modes.record.modes[k];
    const double expected = kRoots[k] * kRoots[k] * std::sqrt(10.0) / (2.0 * std::numbers::pi);
    EXPECT_NEAR(mode.frequency, expected, kLeft[k] * expected);
    ASSERT_EQ(mode.shape.size(), 17u);  // 16 segments and the mark
    EXPECT_EQ(modes.record.places[modes.record.MovesMost(mode)], "tip");
    EXPECT_LT(std::fabs(mode.shape[0][1]), 0.1 * std::fabs(mode.shape[16][1]));
    for (const auto& d : mode.shape) EXPECT_LT(std::fabs(d[0]), 1e-9);  // across the beam alone
  }
}

// Latched, a contact carries its spring: K delta^1.5 x_p = K_t (theta + theta_pre), and is as stiff
// as its law is there: omega^2 = (1.5 K delta^0.5 x_p^2 + K_t) / I.
TEST(FindModes, OfALatchedBarIsThatOfItsContact) {
  const data::Scene scene = data::ParseScene(LatchingBarScene(), "bar.toml");
  const SceneModes modes = FindModes(scene);
  ASSERT_TRUE(modes.usable);
  EXPECT_TRUE(modes.latched);
  ASSERT_EQ(modes.latches.size(), 1u);
  EXPECT_TRUE(modes.latches[0].lower);
  EXPECT_FALSE(modes.latches[0].upper);
  const double K = scene.contacts[0].K, lever = 0.02, stiffness = 0.218;
  const double theta = modes.latches[0].theta, depth = lever * (-theta - 0.0052);
  EXPECT_NEAR(K * std::pow(depth, 1.5) * lever, stiffness * (theta + 1.57), 1e-9);
  const double inertia = 0.02 + 0.5 * 0.3 * 0.3;
  const double square = (1.5 * K * std::sqrt(depth) * lever * lever + stiffness) / inertia;
  ASSERT_EQ(modes.record.modes.size(), 1u);
  EXPECT_NEAR(modes.record.modes[0].frequency, std::sqrt(square) / (2.0 * std::numbers::pi),
              1e-6 * std::sqrt(square));
  // Drawn: held open by nothing, so the spring pulls it shut and no equilibrium is near.
  ModesOptions drawn;
  drawn.state = ModesOptions::State::kDrawn;
  EXPECT_FALSE(FindModes(scene, drawn).latched);
}

// A body and smooth panels that float, folded as drawn: each hinge's contact carries its own
// spring, on the side that this presses, as if it were alone; with a spring that is slack within
// the clearance it rests there.
TEST(FindModes, OfPanelsThatFloatIsThatOfEachContact) {
  constexpr double kPreload[] = {1.2, -0.7, 0.001, 1.2};
  constexpr double kStiffness = 0.35, kClearance = 0.003, kLever = 0.03;
  std::string toml = R"([scene]
name = "panels"
duration = 1.0
[body.bus]
mass = 180.0
inertia = 30.0
pose = [0.0, 0.0, 0.0]
[contact.stop]
radius_i = 0.005
modulus_i = 2.1e11
poisson_i = 0.3
modulus_j = 7.0e10
poisson_j = 0.33
law = "hunt_crossley"
alpha = 0.3
)";
  for (int k = 0; k < 4; ++k) {
    toml += fmt::format(
        "[beam.b{0}]\nlength = 1.5\nmass = 4.5\nEI = 900.0\nmodel = \"kirchhoff\"\norder = 3\n"
        "[joint.j{0}]\ninner = \"{1}\"\nouter = \"b{0}.start\"\nsign = {2}\ntheta = 3.0\n"
        "[joint.j{0}.spring]\nstiffness = {3}\npreload = {4}\n[joint.j{0}.latch]\n"
        "theta_a = {5}\ntheta_b = {5}\nlever = {6}\ncontact = \"stop\"\n",
        k, k == 0 ? std::string("bus") : fmt::format("b{}.end", k - 1), k % 2 == 0 ? 1 : -1,
        kStiffness, kPreload[k], kClearance, kLever);
  }
  const data::Scene scene = data::ParseScene(toml, "panels.toml");
  ModesOptions options;
  options.mesh_error = false;
  const SceneModes modes = FindModes(scene, options);
  ASSERT_TRUE(modes.usable);
  ASSERT_EQ(modes.latches.size(), 4u);
  EXPECT_EQ(modes.rigid, 3);
  for (int k = 0; k < 4; ++k) {
    const SceneModes::Latch& latch = modes.latches[k];
    const double moment = -kStiffness * (latch.theta + kPreload[k]);  // of the spring
    const bool slack = std::fabs(kPreload[k]) < kClearance;
    EXPECT_EQ(latch.upper, !slack && moment > 0.0);
    EXPECT_EQ(latch.lower, !slack && moment < 0.0);
    const double depth = kLever * std::max(0.0, std::fabs(latch.theta) - kClearance);
    const double carried = scene.contacts[0].K * std::pow(depth, 1.5) * kLever;
    EXPECT_NEAR(carried, std::fabs(moment), 1e-9);
  }
}

TEST(FindModes, FilesHoldTheRecord) {
  const data::Scene scene = data::ParseScene(BeamScene("clamped", 4), "beam.toml");
  const SceneModes modes = FindModes(scene);
  const auto path =
      std::filesystem::temp_directory_path() / ("unfurl_modes_" + std::to_string(getpid()) + ".h5");
  data::WriteModes(path.string(), modes.record, {});
  const data::ModesRecord read = data::ReadModes(path.string());
  std::filesystem::remove(path);
  EXPECT_EQ(read.places, modes.record.places);
  EXPECT_EQ(read.rest, modes.record.rest);
  ASSERT_EQ(read.modes.size(), modes.record.modes.size());
  for (std::size_t m = 0; m < read.modes.size(); ++m) {
    EXPECT_EQ(read.modes[m].frequency, modes.record.modes[m].frequency);
    EXPECT_EQ(read.modes[m].damping, modes.record.modes[m].damping);
    EXPECT_EQ(read.modes[m].growth, modes.record.modes[m].growth);
    EXPECT_EQ(read.modes[m].shape, modes.record.modes[m].shape);
  }
  EXPECT_THROW(data::WriteModes("shapes.png", modes.record, {}), Error);
}

// An arm that a drive lifts upright, on it an upside-down pendulum on a spring: sqrt((k - m g r) /
// (I + m r^2)) when it is up, and not sqrt(k ..) of when it lay. While the drive still accelerates,
// the modes are those of an arm that is held.
TEST(FindModes, AtATimeLoadsAndDrivesAreThoseOfThen) {
  const std::string text =
      "[scene]\nname = \"lift\"\nduration = 2.0\n"
      "[body.arm]\nmass = 1.0\ninertia = 0.1\n[body.bob]\nmass = 1.0\ninertia = 0.1\n"
      "[joint.lift]\ninner = \"ground\"\nouter = \"arm\"\n[joint.lift.drive]\nposition = {}\n"
      "[joint.k]\ninner = \"arm\"\ninner_point = [1.0, 0.0]\nouter = \"bob\"\n"
      "outer_point = [-0.5, 0.0]\n[joint.k.spring]\nstiffness = 20.0\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n";
  const double upright = std::sqrt((20.0 - 9.81 * 0.5) / 0.35) / (2.0 * std::numbers::pi);
  for (const char* drive :
       {"\"1.5707963267948966 * smoothstep(t)\"", "\"1.5707963267948966 * t^2 / 2.25\""}) {
    ModesOptions options;
    options.at = 1.5;
    const SceneModes modes =
        FindModes(data::ParseScene(fmt::format(fmt::runtime(text), drive), "lift.toml"), options);
    ASSERT_TRUE(modes.usable);
    ASSERT_EQ(modes.record.modes.size(), 1u);
    EXPECT_NEAR(modes.record.modes[0].frequency, upright, 1e-6) << drive;
  }
}

// A force that turns with its body has no potential, and does nothing about the pin here; as a
// stiffness it would have half of what a force that keeps its direction has.
TEST(FindModes, FollowersAreRefused) {
  const std::string text =
      "[scene]\nname = \"thrust\"\nduration = 1.0\n[body.b]\nmass = 1.0\ninertia = 0.1\n"
      "[joint.j]\ninner = \"ground\"\nouter = \"b\"\nouter_point = [-0.5, 0.0]\n"
      "[joint.j.spring]\nstiffness = 3.0\n[force.f]\non = \"b\"\npoint = [0.5, 0.0]\n"
      "force = [{}, 0.0]\nframe = \"{}\"\n";
  const auto modes = [&](const char* force, const char* frame) {
    return FindModes(
        data::ParseScene(fmt::format(fmt::runtime(text), force, frame), "thrust.toml"));
  };
  EXPECT_THROW(modes("10.0", "body"), Error);
  const double dead = std::sqrt((3.0 + 10.0) / 0.35), none = std::sqrt(3.0 / 0.35);
  EXPECT_NEAR(2.0 * std::numbers::pi * modes("10.0", "world").record.modes.at(0).frequency, dead,
              1e-8);
  // One that does not act yet is none.
  EXPECT_NEAR(2.0 * std::numbers::pi *
                  modes("\"10.0 * step(t - 0.5)\"", "body").record.modes.at(0).frequency,
              none, 1e-8);
}

TEST(FindModes, BadOptionsAreNamed) {
  const NoTraps fence;  // a NaN among them
  const data::Scene scene = data::ParseScene(BeamScene("clamped", 4), "beam.toml");
  const auto refused = [&](const auto& change) {
    ModesOptions options;
    change(options);
    EXPECT_THROW(FindModes(scene, options), Error);
  };
  refused([](auto& o) { o.count = 0; });
  refused([](auto& o) { o.at = -1.0; });
  refused([](auto& o) { o.at = NAN; });
  refused([](auto& o) { o.state = ModesOptions::State::kLatched; });  // no latch
  EXPECT_THROW(ModesStateOf("folded"), Error);
}

}  // namespace
}  // namespace unfurl::sim::find_modes_test
