// Joints, drives and assembly against closed forms of rigid mechanisms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "scenes.h"
#include "sim/dynamics/dynamics.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::mechanisms_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRtol = 1e-10;
// Errors of some thousand steps at kRtol, of quantities of order 1.
constexpr double kClose = 1e-7;

struct Columns : Observer {
  explicit Columns(const Model& model) : observables(model) {}
  void OnSample(double time, double* y, const std::vector<LatchMode>& modes) override {
    t.push_back(time);
    rows.push_back(observables.Row(time, y, modes));
  }
  std::vector<double> Of(const std::string& name) const {
    for (std::size_t q = 0; q < observables.quantities().size(); ++q) {
      if (observables.quantities()[q].name != name) continue;
      std::vector<double> column;
      for (const auto& row : rows) column.push_back(row[q]);
      return column;
    }
    ADD_FAILURE() << "no quantity " << name;
    return std::vector<double>(rows.size());
  }
  Observables observables;
  std::vector<double> t;
  std::vector<std::vector<double>> rows;
};

Columns RunOf(const Model& model, double duration) {
  Columns columns(model);
  SimulateOptions options;
  options.rtol = kRtol;
  options.rate = 100.0;
  options.duration = duration;
  const SimulateReport report = Simulate(model, options, &columns);
  EXPECT_TRUE(report.Usable()) << report.message;
  return columns;
}

// A block on a slope under gravity: a = g sin(slope).
TEST(Slider, BlockSlidesDownASlope) {
  constexpr double kSlope = -0.4;
  const Model model = ModelFrom(
      "[scene]\nname = \"slope\"\nduration = 1.0\n[body.block]\nmass = 3.0\ninertia = 0.2\n"
      "[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\ninner_point = [0.3, 0.2]\n"
      "outer = \"block\"\nouter_point = [0.1, -0.05]\naxis = -0.4\nzero_angle = 0.7\n"
      "travel = 0.25\ntravel_rate = -0.5\n[gravity]\nacceleration = [0.0, -9.81]\n");
  const Columns run = RunOf(model, 1.0);
  const std::vector<double> x = run.Of("block.x"), y = run.Of("block.y"),
                            theta = run.Of("block.theta");
  const double c = std::cos(0.7), s = std::sin(0.7);  // block's angle
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double t = run.t[k];
    const double travel = 0.25 - 0.5 * t + 0.5 * 9.81 * std::sin(0.4) * t * t;
    EXPECT_NEAR(theta[k], 0.7, kClose);
    EXPECT_NEAR(x[k], 0.3 + travel * std::cos(kSlope) - (c * 0.1 + s * 0.05), kClose);
    EXPECT_NEAR(y[k], 0.2 + travel * std::sin(kSlope) - (s * 0.1 - c * 0.05), kClose);
  }
}

TEST(Slider, MassOnASpringSwings) {
  const Model model = ModelFrom(
      "[scene]\nname = \"spring\"\nduration = 2.0\n[body.block]\nmass = 2.0\ninertia = 0.2\n"
      "[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"block\"\naxis = 1.1\n"
      "sign = -1\ntravel = 0.3\n[joint.rail.spring]\nstiffness = 50.0\nfree = 0.1\n");
  const Columns run = RunOf(model, 2.0);
  const std::vector<double> x = run.Of("block.x"), travel = run.Of("rail.travel");
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double expected = 0.1 + 0.2 * std::cos(5.0 * run.t[k]);
    EXPECT_NEAR(travel[k], expected, kClose);
    EXPECT_NEAR(x[k], -expected * std::cos(1.1), kClose);
  }
}

// Scotch yoke: a crank at a steady rate carries a pin in the upright slot of a sliding yoke, which
// then moves as r cos(omega t); the drive's work is the yoke's kinetic energy.
TEST(PinInSlot, ScotchYokeMovesHarmonically) {
  const Model model = ModelFrom(
      "[scene]\nname = \"yoke\"\nduration = 2.0\n"
      "[body.crank]\nmass = 0.4\ninertia = 0.01\n[body.yoke]\nmass = 1.5\ninertia = 0.1\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"crank\"\n[joint.pivot.drive]\nrate = 4.0\n"
      "[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"yoke\"\ntravel = 0.2\n"
      "[joint.slot]\ntype = \"pin_in_slot\"\ninner = \"yoke\"\nouter = \"crank\"\n"
      "outer_point = [0.2, 0.0]\naxis = 1.5707963267948966\n");
  const Columns run = RunOf(model, 2.0);
  const std::vector<double> x = run.Of("yoke.x"), y = run.Of("yoke.y"), v = run.Of("yoke.vx"),
                            theta = run.Of("crank.theta"), work = run.Of("energy.work"),
                            slot = run.Of("slot.travel");
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double t = run.t[k];
    EXPECT_NEAR(theta[k], 4.0 * t, kClose);
    EXPECT_NEAR(x[k], 0.2 * std::cos(4.0 * t), kClose);
    EXPECT_NEAR(v[k], -0.8 * std::sin(4.0 * t), kClose);
    EXPECT_NEAR(y[k], 0.0, kClose);
    EXPECT_NEAR(slot[k], 0.2 * std::sin(4.0 * t), kClose);
    EXPECT_NEAR(work[k], 0.75 * v[k] * v[k], kClose);
  }
}

// The slider's place of a crank of radius r and a rod of length l: r cos + sqrt(l^2 - r^2 sin^2).
std::string SliderCrank(const std::string& drive, const std::string& rod) {
  return "[scene]\nname = \"slider-crank\"\nduration = 1.0\n"
         "[body.crank]\nmass = 0.3\ninertia = 0.002\n[body.slider]\nmass = 0.2\ninertia = 0.001\n" +
         rod +
         "[joint.pivot]\ninner = \"ground\"\nouter = \"crank\"\nouter_point = [-0.05, 0.0]\n" +
         drive +
         "[joint.wrist]\ninner = \"slider\"\nouter = \"rod.end\"\ntheta = 0.1\n"
         "[joint.big_end]\ninner = \"crank\"\ninner_point = [0.05, 0.0]\nouter = \"rod.start\"\n"
         "[joint.rail]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"slider\"\ntravel = 0.4\n"
         "[mark.middle]\non = \"rod\"\nat = 0.5\n";
}

constexpr char kRod[] = "[beam.rod]\nlength = 0.3\nmass = 0.1\nEI = 1e5\nsegments = 1\n";

TEST(Drive, PositionExpressionMovesTheSliderCrank) {
  const Model model = ModelFrom(
      SliderCrank("[joint.pivot.drive]\nposition = \"0.4 + 2 * t + 0.5 * sin(3 * t)\"\n", kRod));
  const Columns run = RunOf(model, 1.0);
  const std::vector<double> x = run.Of("slider.x"), residual = run.Of("energy.residual");
  for (std::size_t k = 0; k < run.t.size(); ++k) {
    const double t = run.t[k], a = 0.4 + 2.0 * t + 0.5 * std::sin(3.0 * t);
    const double up = 0.1 * std::sin(a);
    EXPECT_NEAR(x[k], 0.1 * std::cos(a) + std::sqrt(0.09 - up * up), kClose);
    EXPECT_NEAR(residual[k], 0.0, kClose);
  }
}

TEST(Drive, TheFirstVelocitiesAreThoseOfTheRigidMechanism) {
  const Model model =
      ModelFrom(SliderCrank("theta = 0.3\n[joint.pivot.drive]\nrate = 20.0\n",
                            "[beam.rod]\nlength = 0.3\nmass = 0.1\nEI = 16.0\nsegments = 8\n"));
  const double a = 0.3, w = 20.0, up = 0.1 * std::sin(a), along = std::sqrt(0.09 - up * up);
  const StateIndex& index = model.index;
  const Model::Beam& rod = model.beams[0];
  const double rod_rate = -0.1 * w * std::cos(a) / along;
  for (int k = rod.first; k < rod.first + rod.segments; ++k) {
    EXPECT_NEAR(model.initial_state[index.omega(k)], rod_rate, 1e-11);
  }
  const int slider = model.bodies[1].centre.body;
  EXPECT_NEAR(model.initial_state[index.vx(slider)],
              -0.1 * w * std::sin(a) - 0.1 * up * w * std::cos(a) / along, 1e-11);
}

// Two beams welded end to end are one beam: the first bending frequencies are those of the whole.
// A beam's own end under a spring: mass and its first moment stay those of the beam.
TEST(EndBodies, KeepMassAndCentre) {
  for (const int n : {2, 3, 8}) {
    const Model model =
        ModelFrom(fmt::format("[scene]\nname = \"ends\"\nduration = 1.0\n"
                              "[beam.a]\nlength = 0.8\nmass = 0.4\nEI = 5.0\nsegments = {}\n"
                              "[beam.b]\nlength = 0.6\nmass = 0.3\nEI = 5.0\nsegments = {}\n"
                              "[weld.both]\ninner = \"a.end\"\nouter = \"b.start\"\nangle = 0.5\n"
                              "[joint.root]\ninner = \"ground\"\nouter = \"a.start\"\n"
                              "[joint.root.spring]\nstiffness = 1.0\n",
                              n, n));
    std::vector<double> y = model.initial_state;
    Dynamics dynamics(model);
    const Balance balance = dynamics.BalanceAt(0.0, y.data());
    const double bx = 0.8 + 0.3 * std::cos(0.5), by = 0.3 * std::sin(0.5);
    EXPECT_NEAR(balance.centre_x, (0.4 * 0.4 + 0.3 * bx) / 0.7, 1e-14);
    EXPECT_NEAR(balance.centre_y, 0.3 * by / 0.7, 1e-14);
    EXPECT_TRUE(model.bodies.empty());  // they are nobody's bodies
  }
}

TEST(Drive, DrivesThatFightAreRefusedByName) {
  try {
    ModelFrom(
        "[scene]\nname = \"fight\"\nduration = 1.0\n[body.a]\nmass = 1.0\ninertia = 1.0\n"
        "[body.b]\nmass = 1.0\ninertia = 1.0\n"
        "[joint.one]\ninner = \"ground\"\nouter = \"a\"\n[joint.one.drive]\nrate = 1.0\n"
        "[joint.two]\ninner = \"a\"\ninner_point = [1.0, 0.0]\nouter = \"b\"\n"
        "[joint.two.drive]\nrate = 1.0\n"
        "[joint.three]\ntype = \"slider\"\ninner = \"ground\"\ninner_point = [1.0, 0.0]\n"
        "outer = \"b\"\n[joint.three.drive]\nposition = 0.5\n");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'three'"), std::string::npos) << error.what();
  }
}

// A crank, a rod and a slot in the ground, drawn far from closed, turned and carried away as a
// whole: where the world's origin lies is no part of how the loop closes.
TEST(Assembly, ClosesALoopAlikeWhereverTheOriginIs) {
  const auto crank_at = [](double turn, double x, double y) {
    const double c = std::cos(turn), s = std::sin(turn);
    const auto at = [&](double px, double py) {
      return fmt::format("[{:.17g}, {:.17g}]", x + c * px - s * py, y + s * px + c * py);
    };
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = \"slot\"\nduration = 1.0\n"
        "[body.crank]\nmass = 1.0\ninertia = 0.01\n[body.rod]\nmass = 1.0\ninertia = 0.03\n"
        "[joint.a]\ninner = \"ground\"\ninner_point = {}\nouter = \"crank\"\n"
        "outer_point = [-0.2, 0.0]\nzero_angle = {:.17g}\ntheta = 0.4\n"
        "[joint.b]\ninner = \"crank\"\ninner_point = [0.2, 0.0]\nouter = \"rod\"\n"
        "outer_point = [-0.4, 0.0]\ntheta = -0.9\n"
        "[joint.c]\ntype = \"pin_in_slot\"\ninner = \"ground\"\ninner_point = {}\n"
        "outer = \"rod\"\nouter_point = [0.4, 0.0]\naxis = {:.17g}\ntravel = 0.3\n"
        "zero_angle = {:.17g}\n",
        at(0.0, 0.0), turn, at(0.5, 0.4), turn + 0.3, turn));
    const Columns start = RunOf(model, 1e-3);
    return std::pair{start.Of("a.theta").front(), start.Of("c.travel").front()};
  };
  const auto [angle, travel] = crank_at(0.0, 0.0, 0.0);
  for (const auto& [turn, x, y] : {std::array{1.1, 0.0, 0.0}, std::array{0.0, 5.0, -3.0},
                                   std::array{-2.0, 1e3, 4e2}, std::array{0.4, -1e6, 2e6}}) {
    const auto [angle_there, travel_there] = crank_at(turn, x, y);
    const double rounding = 1e-10 + 1e-15 * std::hypot(x, y);
    EXPECT_NEAR(angle_there, angle, 100.0 * rounding) << turn << " " << x;
    EXPECT_NEAR(travel_there, travel, 100.0 * rounding) << turn << " " << x;
  }
}

}  // namespace
}  // namespace unfurl::sim::mechanisms_test
