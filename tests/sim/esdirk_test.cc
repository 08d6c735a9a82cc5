#include "sim/implicit/esdirk.h"

#include <gtest/gtest.h>

#include <cmath>

#include "runs.h"
#include "scenes.h"
#include "sim/methods/dormand_prince.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::esdirk_test {
namespace {

// To which stages are solved where steps are given: far below the errors that show the order.
constexpr double kSolved = 1e-11;

// The conditions of order four (Hairer, Norsett and Wanner, II.2), three of the embedded weights,
// and of stage order two; the coefficients are quotients, rounded.
TEST(Esdirk, OrderConditions) {
  constexpr double kDigits = 1e-14;
  constexpr int s = EsdirkTable::kStages;
  const EsdirkTable& t = Ark436();
  const auto a = [&](int i, int j) { return i == j ? (i > 0 ? t.gamma : 0.0) : t.a[i][j]; };
  const auto sum = [&](const auto& weight, const auto& term) {
    double total = 0.0;
    for (int i = 0; i < s; ++i) total += weight(i) * term(i);
    return total;
  };
  const auto along = [&](const auto& term) {  // (A term)_i
    return [&a, term](int i) {
      double total = 0.0;
      for (int j = 0; j <= i; ++j) total += a(i, j) * term(j);
      return total;
    };
  };
  const auto b = [&](int i) { return a(s - 1, i); };
  const auto b_hat = [&](int i) { return t.b_hat[i]; };
  const auto one = [](int) { return 1.0; };
  const auto c = [&](int i) { return t.c[i]; };
  const auto c2 = [&](int i) { return t.c[i] * t.c[i]; };
  const auto c3 = [&](int i) { return t.c[i] * t.c[i] * t.c[i]; };
  const auto third = [&](const auto& weight) {
    EXPECT_NEAR(sum(weight, one), 1.0, kDigits);
    EXPECT_NEAR(sum(weight, c), 1.0 / 2, kDigits);
    EXPECT_NEAR(sum(weight, c2), 1.0 / 3, kDigits);
    EXPECT_NEAR(sum(weight, along(c)), 1.0 / 6, kDigits);
  };
  third(b);
  third(b_hat);
  EXPECT_NEAR(sum(b, c3), 1.0 / 4, kDigits);
  EXPECT_NEAR(sum(b, [&](int i) { return t.c[i] * along(c)(i); }), 1.0 / 8, kDigits);
  EXPECT_NEAR(sum(b, along(c2)), 1.0 / 12, kDigits);
  EXPECT_NEAR(sum(b, along(along(c))), 1.0 / 24, kDigits);
  for (int i = 0; i < s; ++i) {
    EXPECT_NEAR(along(one)(i), t.c[i], kDigits);
    EXPECT_NEAR(along(c)(i), 0.5 * c2(i), kDigits);
  }
}

// A swinging beam on a pin: what the tangent leaves out (the constraints turn) costs no order.
TEST(Esdirk, FourthOrderOnASwingingBeam) {
  const Model model = ModelFrom(
      "[scene]\nname = \"swing\"\nduration = 1.0\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 3\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"rod.start\"\ntheta = 0.3\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n");
  constexpr double kEnd = 0.1;
  ErrorScale scale;
  scale.rtol = kAnyError;
  Dynamics dynamics(model);
  DormandPrince reference(dynamics, scale);
  const std::vector<double> exact = Fixed(&reference, model, kEnd, 4000);
  scale.rtol = kSolved;
  Esdirk stepper(dynamics, scale, Ark436());
  double error[3];
  for (int k = 0; k < 3; ++k) {
    const std::vector<double> y = Fixed(&stepper, model, kEnd, 200 << k);
    error[k] = 0.0;
    for (int s = 0; s < model.rigid_bodies.count; ++s) {
      if (!model.rigid_bodies.IsDynamic(s)) continue;
      for (int d = 0; d < 6; ++d) {
        const int i = d * model.rigid_bodies.count + s;
        error[k] = std::max(error[k], std::fabs(y[i] - exact[i]));
      }
    }
  }
  // 4, but for the next power at these steps.
  for (int k = 0; k < 2; ++k) {
    const double order = std::log2(error[k] / error[k + 1]);
    EXPECT_GT(order, 3.8);
    EXPECT_LT(order, 4.3);
  }
}

// What is allowed after a step that failed grows with each that is solved, but not past all
// numbers.
TEST(Esdirk, ThousandsOfStepsAfterOneThatFailed) {
  const Model model = ModelFrom(PendulumScene(0.7));
  ErrorScale scale;
  scale.rtol = kAnyError;
  Dynamics dynamics(model);
  Esdirk stepper(dynamics, scale, Ark436());
  stepper.Start(0.0, model.initial_state);
  ASSERT_GT(stepper.Try(1e3), 1.0);  // a thousand swings in a step
  // log(1.8e308) / log(1.1) is below 7500.
  for (int k = 1; k <= 7500; ++k) {
    ASSERT_LE(stepper.Try(1e-3), 1.0) << k;
    stepper.Accept(1e-3 * k);
  }
}

// The dense output: a cubic for positions, its derivative for velocities.
TEST(Esdirk, DenseOutput) {
  const Model model = ModelFrom(PendulumScene(0.7));
  ErrorScale scale;
  scale.rtol = kAnyError;
  Dynamics dynamics(model);
  const double h = 0.01;
  Esdirk stepper(dynamics, scale, Ark436());
  stepper.Start(0.0, model.initial_state);
  stepper.Try(h);
  DormandPrince reference(dynamics, scale);
  const std::vector<double> middle = Fixed(&reference, model, 0.4 * h, 20);
  std::vector<double> dense(model.index.size());
  stepper.Dense(0.4, dense.data());
  const int body = model.bodies[0].centre.body;
  // Of a position's fourth derivative, 2e3 at most, the cubic leaves h^4 / 384 and the step h^4 /
  // 20; of the same, the cubic's derivative leaves s (1 - s) (1 - 2 s) h^3 / 12 to the velocities.
  constexpr double kFourth = 2e3;
  const double position = kFourth * std::pow(h, 4) / 20.0;
  const double velocity = kFourth * std::pow(h, 3) * 0.4 * 0.6 * 0.2 / 12.0 + position;
  const auto expect = [&](int i, double tolerance) {
    EXPECT_NEAR(dense[i], middle[i], tolerance);
    EXPECT_NEAR(stepper.Polynomial(i)(0.4), dense[i], 1e-14);
  };
  expect(model.index.theta(body), position);
  expect(model.index.x(body), position);
  expect(model.index.omega(body), velocity);
}

// A short step after which the drift of many is taken out of places: that is no velocity.
TEST(Esdirk, WhatIsBroughtBackIsNoVelocity) {
  const Model model = ModelFrom(PendulumScene(0.7));
  ErrorScale scale;
  scale.rtol = kAnyError;
  Dynamics dynamics(model);
  const double h = 1e-6, drift = 1e-6;  // over one another: 1 m/s
  Esdirk stepper(dynamics, scale, Ark436());
  stepper.Start(0.0, model.initial_state);
  stepper.Try(h);
  const int x = model.index.x(model.bodies[0].centre.body);
  stepper.trial()[x] += drift;
  stepper.RefreshTrial();
  std::vector<double> dense(model.index.size());
  stepper.Dense(0.5, dense.data());
  const int n3 = 3 * model.index.n;
  EXPECT_NEAR(dense[n3 + x], 0.5 * (stepper.state()[n3 + x] + stepper.trial()[n3 + x]), 1e-9);
  EXPECT_NEAR(dense[x], stepper.state()[x] + 0.5 * drift, 1e-9);
  EXPECT_LT(stepper.DenseDoubt(0.5), 1e-9 / kAnyError);
}

// Energy, stored and dissipated, against that at the start.
struct EnergyWatch : Observer {
  explicit EnergyWatch(const Model& model) : dynamics(model) {}
  void OnSample(double t, double* y, const std::vector<LatchMode>& modes) override {
    dynamics.modes() = modes;
    const Balance b = dynamics.BalanceAt(t, y);
    const double total = b.Stored() + b.Dissipated();
    if (first) start = total;
    first = false;
    most = std::max(most, total - start);
    least = std::min(least, total - start);
  }
  Dynamics dynamics;
  bool first = true;
  double start = 0.0, most = 0.0, least = 0.0;
};

// Between the steps, too: accelerations of a fine mesh are far greater than the steps go through,
// and samples made from them held thousands of times the energy that there is.
TEST(Esdirk, SamplesOfAFineMeshHoldTheEnergy) {
  const Model model = ModelFrom(R"([scene]
name = "boom"
duration = 0.3
[gravity]
acceleration = [0.0, -9.81]
[beam.b]
length = 10.0
mass = 5.0
EI = 200.0
damping = 1e-3
segments = 100
[joint.pivot]
type = "revolute"
inner = "ground"
outer = "b.start"
)");
  SimulateOptions options;
  options.method = Method::kImplicit;
  options.rtol = 1e-3;
  EnergyWatch watch(model);
  const SimulateReport report = Simulate(model, options, &watch);
  ASSERT_TRUE(report.Usable()) << report.message;
  // What gravity gives in that time, m g L / 2 (1 - cos) of a turn of 3 g t^2 / (4 L), is 18 J.
  const double scale = 18.0;
  EXPECT_LT(watch.most, options.rtol * scale);
  EXPECT_GT(watch.least, -options.rtol * scale);
}

// At a loose tolerance high modes are damped, never fed: what is gained stays within the tolerance
// of the energy at the start (the springs'), what is lost may be more. A bar that bounces has no
// such modes: its energy is as exact as every method's, ten tolerances.
TEST(Esdirk, InventsNoEnergy) {
  data::Scene scene = data::ReadScene(DeploymentPath("clearance"));
  for (auto& beam : scene.beams) beam.axial_elastic = true;
  const struct {
    Model model;
    double tolerances;
  } cases[] = {{Compile(scene), 1.0}, {ModelFrom(LatchingBarScene()), 10.0}};
  for (const double rtol : {1e-3, 5e-4, 1e-4}) {
    for (const auto& [model, tolerances] : cases) {
      SimulateOptions options;
      options.method = Method::kImplicit;
      options.rtol = rtol;
      options.duration = std::min(model.duration, 1.8);  // beyond the first latches
      EnergyWatch watch(model);
      const SimulateReport report = Simulate(model, options, &watch);
      ASSERT_TRUE(report.Usable()) << report.message;
      EXPECT_GT(report.Count(EventKind::kContactStart), 0);
      EXPECT_LT(watch.most, tolerances * rtol * watch.start) << rtol;
      EXPECT_LT(watch.least, 0.0);
    }
  }
}

// Stiff by its damping: explicit steps are bound by beta omega^2, implicit ones are not.
TEST(Esdirk, StiffBeamInFewSteps) {
  const Model model =
      ModelFrom(BeamScene("clamped", 24, "damping = 1e-3\nEA = 1e6\naxial = \"elastic\"\n") +
                "[gravity]\nacceleration = [0.0, -9.81]\n");
  constexpr double kRtol = 1e-5;
  const auto tip = [&](Method method, SimulateReport* report) {
    SimulateOptions options;
    options.method = method;
    options.rtol = kRtol;
    options.duration = 0.1;
    options.track_energy = false;
    MarkTracks tracks = SimulateMarks(model, options);
    *report = tracks.report;
    return tracks.y[0];
  };
  SimulateReport implicit, projected;
  const std::vector<double> a = tip(Method::kImplicit, &implicit);
  const std::vector<double> b = tip(Method::kProjected, &projected);
  ASSERT_TRUE(implicit.Usable());
  EXPECT_LT(100 * implicit.evaluations, projected.evaluations);
  double worst = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) worst = std::max(worst, std::fabs(a[k] - b[k]));
  EXPECT_LT(worst, 10.0 * kRtol);  // of 1 m; tolerances mean what they say within ten
}

}  // namespace
}  // namespace unfurl::sim::esdirk_test
