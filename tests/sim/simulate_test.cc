#include "sim/methods/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "base/error.h"
#include "runs.h"
#include "scenes.h"
#include "sim/dynamics/observables.h"
#include "tests/traps.h"

namespace unfurl::sim::simulate_test {
namespace {

data::Scene Deployment(const std::string& variant, int segments) {
  data::Scene scene = data::ReadScene(DeploymentPath(variant));
  for (auto& beam : scene.beams) beam.segments = segments;
  return scene;
}

TEST(Simulate, PendulumKeepsItsPeriod) {
  // Period of a physical pendulum released at rest: 4 sqrt(I / (m g r)) K(sin(theta0 / 2)).
  const double theta0 = 2.0, r = 0.5, I = 0.1 + 2.0 * r * r;
  const double period =
      4.0 * std::sqrt(I / (2.0 * 9.81 * r)) * std::comp_ellint_1(std::sin(theta0 / 2.0));
  SimulateOptions options;
  options.duration = 10.0 * period;
  options.rate = 10.0 / options.duration;  // once per period
  options.rtol = 1e-10;
  const MarkTracks tracks = SimulateMarks(ModelFrom(PendulumScene(theta0)), options);
  ASSERT_TRUE(tracks.report.Usable());
  ASSERT_EQ(tracks.t.size(), 11u);
  // Global error of some 3000 steps at 1e-10 each.
  for (std::size_t i = 1; i < tracks.t.size(); ++i) {
    EXPECT_NEAR(tracks.x[0][i], tracks.x[0][0], 1e-7);
    EXPECT_NEAR(tracks.y[0][i], tracks.y[0][0], 1e-7);
    EXPECT_NEAR(tracks.vx[0][i], 0.0, 1e-6);
  }
}

TEST(Simulate, ErrorFollowsTheTolerance) {
  SimulateOptions options;
  options.duration = 5.0;
  options.max_step = 1.0;  // the tolerance alone decides
  options.rtol = 1e-12;
  const Model model = ModelFrom(PendulumScene(2.5));
  const MarkTracks reference = SimulateMarks(model, options);
  for (const double rtol : {1e-5, 1e-7, 1e-9}) {
    options.rtol = rtol;
    const double error = FarthestApart(SimulateMarks(model, options), reference, 0);
    // Relative to the range of 1 m: errors add up over some ten swings, tolerance by tolerance.
    EXPECT_LT(error, 100 * rtol);
    EXPECT_GT(error, 0.01 * rtol);  // and work is not wasted
  }
}

TEST(Simulate, FlexibleDoublePendulumKeepsItsEnergy) {
  std::string text =
      "[scene]\nname = \"two beams\"\nduration = 1.0\n"
      "[beam.a]\nlength = 0.8\nmass = 0.424\nEI = 18.69\nsegments = 4\n"
      "[beam.b]\nlength = 0.8\nmass = 0.424\nEI = 18.69\nsegments = 4\n"
      "[joint.one]\ninner = \"ground\"\nouter = \"a.start\"\ntheta = 0.3\n"
      "[joint.two]\ninner = \"a.end\"\nouter = \"b.start\"\ntheta = 1.2\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = \"b.end\"\n";
  const Model model = ModelFrom(text);
  struct Energy : Observer {
    explicit Energy(const Model& m) : observables(m) {}
    void OnSample(double t, double* y, const std::vector<LatchMode>& modes) override {
      observables.Row(t, y, modes);
      const double residual = observables.balance().Stored() - observables.energy_at_start();
      worst = std::max(worst, std::fabs(residual));
      scale = std::max(scale, observables.balance().kinetic);
    }
    Observables observables;
    double worst = 0.0, scale = 0.0;
  };
  Energy energy(model);
  SimulateOptions options;
  options.rtol = 1e-10;
  ASSERT_TRUE(Simulate(model, options, &energy).Usable());
  EXPECT_GT(energy.scale, 1.0);
  EXPECT_LT(energy.worst, 1e-9 * energy.scale);
}

TEST(Simulate, TurningAndMovingTheSceneTurnsAndMovesTheMarks) {
  data::Scene scene = Deployment("clearance", 3);
  SimulateOptions options;
  options.duration = 0.6;
  options.rtol = 1e-7;
  const MarkTracks here = SimulateMarks(Compile(scene), options);
  const double angle = 0.7, x0 = 3.0, y0 = -2.0;
  scene.bodies[0].pose = {x0, y0, angle};
  const MarkTracks there = SimulateMarks(Compile(scene), options);
  // Rounding differs, and with it which steps are accepted: within the error that rtol allows.
  constexpr double kTolerance = 1e-8;
  for (std::size_t m = 0; m < here.x.size(); ++m) {
    for (std::size_t i = 0; i < here.t.size(); ++i) {
      const double x = here.x[m][i], y = here.y[m][i];
      EXPECT_NEAR(there.x[m][i], x0 + std::cos(angle) * x - std::sin(angle) * y, kTolerance);
      EXPECT_NEAR(there.y[m][i], y0 + std::sin(angle) * x + std::cos(angle) * y, kTolerance);
    }
  }
}

TEST(Simulate, LikeArmsMoveAsMirrorImages) {
  data::Scene scene = Deployment("clearance", 3);
  scene.beams[3] = scene.beams[1];
  scene.beams[3].name = "beam4";
  scene.marks.push_back({"left", scene.marks[3].on, ""});
  scene.marks.back().on.index = 3;
  SimulateOptions options;
  options.duration = 2.0;
  const Model model = Compile(scene);
  const MarkTracks tracks = SimulateMarks(model, options);
  const std::size_t left = 4, right = 3;
  constexpr double kTolerance = 1e-7;  // rounding, amplified by the impacts up to 2 s
  for (std::size_t i = 0; i < tracks.t.size(); ++i) {
    EXPECT_NEAR(tracks.x[left][i], -tracks.x[right][i], kTolerance);
    EXPECT_NEAR(tracks.y[left][i], tracks.y[right][i], kTolerance);
  }
}

TEST(Simulate, SamplesDoNotChangeTheSteps) {
  const Model model = Compile(Deployment("clearance", 2));
  SimulateOptions options;
  options.duration = 1.0;
  const MarkTracks slow = SimulateMarks(model, options);
  options.rate = 7000.0;
  const MarkTracks fast = SimulateMarks(model, options);
  EXPECT_EQ(slow.report.evaluations, fast.report.evaluations);
  EXPECT_EQ(slow.t.size(), 1001u);
  EXPECT_EQ(fast.t.size(), 7001u);
  EXPECT_EQ(slow.x[3][1000], fast.x[3][7000]);
}

TEST(Simulate, VelocitiesAreTheDerivativesOfPositions) {
  const Model model = Compile(Deployment("suspension", 4));
  SimulateOptions options;
  options.duration = 0.3;
  options.rate = 20000.0;
  const MarkTracks t = SimulateMarks(model, options);
  for (std::size_t m = 0; m < t.x.size(); ++m) {
    for (std::size_t i = 1; i + 1 < t.t.size(); ++i) {
      const double dt = t.t[i + 1] - t.t[i - 1];
      EXPECT_NEAR((t.x[m][i + 1] - t.x[m][i - 1]) / dt, t.vx[m][i], 1e-3);
      EXPECT_NEAR((t.y[m][i + 1] - t.y[m][i - 1]) / dt, t.vy[m][i], 1e-3);
    }
  }
}

TEST(Simulate, ThreadsDoNotDisturbEachOther) {
  const Model model = Compile(Deployment("suspension", 2));
  SimulateOptions options;
  options.duration = 1.0;
  const MarkTracks alone = SimulateMarks(model, options);
  MarkTracks a, b;
  std::thread first([&] { a = SimulateMarks(model, options); });
  std::thread second([&] { b = SimulateMarks(model, options); });
  first.join();
  second.join();
  EXPECT_EQ(a.x, alone.x);
  EXPECT_EQ(b.y, alone.y);
}

TEST(Simulate, RunningAwayIsAStatusWithWhatWasReached) {
  const NoTraps fence;  // steps overflow and are given up
  // A spring so stiff and a body so light that no step is small enough for the tolerance.
  std::string text = LatchingBarScene();
  text.replace(text.find("stiffness = 0.218"), 17, "stiffness = 1e60");
  const Model model = ModelFrom(text);
  SimulateOptions options;
  const MarkTracks tracks = SimulateMarks(model, options);
  EXPECT_FALSE(tracks.report.Usable());
  EXPECT_NE(tracks.report.message.find("body 'bar'"), std::string::npos) << tracks.report.message;
  EXPECT_GE(tracks.t.size(), 1u);
}

TEST(Simulate, StopsAtTheMostSteps) {
  SimulateOptions options;
  options.max_steps = 512;
  const SimulateReport report = Simulate(Compile(Deployment("clearance", 4)), options, nullptr);
  EXPECT_EQ(report.status, SimulateStatus::kTooManySteps);
  EXPECT_GT(report.t_end, 0.0);
}

TEST(SimulateOptions, RefusesWhatCannotBe) {
  const NoTraps fence;  // a NaN among them
  const auto refused = [](auto change) {
    SimulateOptions options;
    change(options);
    EXPECT_THROW(options.Check(), Error);
  };
  refused([](auto& o) { o.rtol = 0.0; });
  refused([](auto& o) { o.rtol = 1.0; });
  refused([](auto& o) { o.rtol = NAN; });
  refused([](auto& o) { o.rate = 0.0; });
  refused([](auto& o) { o.duration = 1e9; });
  refused([](auto& o) { o.duration = -1.0; });
  refused([](auto& o) { o.max_step = -1.0; });
  refused([](auto& o) { o.max_steps = 0; });
  refused([](auto& o) { o.time = INFINITY; });
  SimulateOptions().Check();
}

// What the scene holds and the tolerance decide; docs/decisions/012-implicit.md.
TEST(Simulate, AutoTakesTheMethodThatTheSceneCallsFor) {
  const auto method = [](const std::string& more, double rtol) {
    SimulateOptions options;
    options.rtol = rtol;
    options.duration = 1e-4;
    const std::string sags = "[gravity]\nacceleration = [0.0, -9.81]\n";
    return Simulate(ModelFrom(BeamScene("clamped", 24, more) + sags), options, nullptr).method;
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(method("", 1e-3), HasSubstr("Runge-Kutta 4(3)"));
  EXPECT_THAT(method("", 1e-5), HasSubstr("5(4)"));
  EXPECT_THAT(method("", 1e-8), HasSubstr("8(5,3)"));
  const std::string damped = "damping = 1e-3\n", elastic = "axial = \"elastic\"\nEA = 1e8\n";
  for (const std::string& stiff : {damped, elastic}) {
    EXPECT_THAT(method(stiff, 1e-4), HasSubstr("diagonally implicit")) << stiff;
  }
  EXPECT_THAT(method(damped, 1e-8), HasSubstr("8(5,3)"));
  // From rest strains of 1e-8 m hold more than moves; it is tried later whether explicit steps pay.
  EXPECT_THAT(method(elastic, 1e-8), HasSubstr("diagonally implicit"));
}

}  // namespace
}  // namespace unfurl::sim::simulate_test
