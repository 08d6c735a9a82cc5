// Functions of time whose edges are where a run begins and ends.
#include "sim/methods/edges.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::edges_test {
namespace {

// Of the driven joint and of its drive, by sample.
struct Driven : Observer {
  explicit Driven(const Model& model)
      : observables(model, {"pivot.theta_rate", "pivot.drive_moment"}) {}
  void OnSample(double t, double* state, const std::vector<LatchMode>& modes) override {
    const std::vector<double>& row = observables.Row(t, state, modes);
    rate.push_back(row[0]);
    moment.push_back(row[1]);
  }
  Observables observables;
  std::vector<double> rate, moment;  // [rad/s], [N m]
  SimulateReport report;
};

// An arm on a driven bar.
Driven Drive(const std::string& drive, Method method) {
  const Model model = ModelFrom(
      "[scene]\nname = \"drive\"\nduration = 1.0\n"
      "[body.bar]\nmass = 1.0\ninertia = 0.1\n[body.arm]\nmass = 0.3\ninertia = 0.02\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.5, 0.0]\n"
      "[joint.pivot.drive]\n" +
      drive +
      "\n[joint.elbow]\ninner = \"bar\"\ninner_point = [0.3, 0.0]\nouter = \"arm\"\n"
      "outer_point = [-0.2, 0.1]\ntheta = 0.5\n[joint.elbow.spring]\nstiffness = 3.0\n");
  SimulateOptions options;
  options.method = method;
  options.rate = 1000.0;
  Driven driven(model);
  driven.report = Simulate(model, options, &driven);
  EXPECT_TRUE(driven.report.Usable()) << drive << ": " << driven.report.message;
  return driven;
}

// A table whose points are the start and the end, and ramps from and to there: the rate is that of
// the piece between, at both. It was zero there, which was told as an energy that is not balanced.
TEST(Edges, WhereARunBeginsAndEnds) {
  const struct {
    const char* drive;
    double first, last;  // rates [rad/s]
  } cases[] = {
      // Second derivatives of the natural spline through three points: 0, m, 0 with m = -6.
      {"position = {t = [0.0, 0.5, 1.0], value = [0.0, 0.5, 0.0]}", 1.5, -1.5},
      {"position = \"0.5 * ramp(t) - 0.5 * ramp(t - 1.0)\"", 0.5, 0.5},
      {"rate = {t = [0.0, 0.4, 1.0], value = [0.3, 0.5, 0.1], interpolation = \"linear\"}", 0.3,
       0.1},
  };
  for (const auto& c : cases) {
    for (const Method method : {Method::kProjected, Method::kImplicit, Method::kPartitioned}) {
      const Driven driven = Drive(c.drive, method);
      EXPECT_NEAR(driven.rate.front(), c.first, 1e-6) << c.drive;
      EXPECT_NEAR(driven.rate.back(), c.last, 1e-6) << c.drive;
      EXPECT_LT(driven.report.energy_residual, 1e-5 * driven.report.energy_moved) << c.drive;
      // Nothing jumps at the end: a sample before, the drive gives nearly the same.
      const std::size_t n = driven.moment.size();
      EXPECT_NEAR(driven.moment[n - 1], driven.moment[n - 2], 0.02) << c.drive;
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::edges_test
