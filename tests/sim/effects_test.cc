// Dampers, friction, motors, moment tables, springs between points, forces from outside: each held
// to a closed form, and all together to the balance of energy. What every
// effect owes: effect_list_test.cc.
#include "effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "sim/dynamics/dynamics.h"
#include "sim/model/load_point.h"

namespace unfurl::sim::effects_test {
namespace {

using ::testing::HasSubstr;

// Each step may be wrong by kTight of 1 rad or 1 m; a run of some hundred steps by a hundred times
// that, another ten for what the motion itself stretches.
constexpr double kClosedForm = 1000 * kTight;

TEST(Effects, DampedOscillator) {
  const double m = 2.0, k = 50.0, c = 3.0, x0 = 0.2, v0 = -0.4, free = 0.1;
  const Model model = ModelFrom(BlockScene(
      fmt::format("travel = {}\ntravel_rate = {}\n[joint.slide.spring]\nstiffness = {}\nfree = {}\n"
                  "[joint.slide.damper]\ndamping = {}\n",
                  x0, v0, k, free, c)));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> x = run["block.x"], lost = run["energy.dissipated_dampers"];
  const double a = c / (2 * m), w = std::sqrt(k / m - a * a), b = (v0 + a * (x0 - free)) / w;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double t = run.t[i], e = std::exp(-a * t);
    const double u = e * ((x0 - free) * std::cos(w * t) + b * std::sin(w * t));
    EXPECT_NEAR(x[i], free + u, kClosedForm);
    EXPECT_GE(lost[i], 0.0);
  }
  EXPECT_LT(run.residual, kClosedForm * k * x0 * x0);
  EXPECT_GT(lost.back(), 0.5 * (0.5 * m * v0 * v0));
}

// I dw/dt = -M tanh(w / w_c) gives sinh(w / w_c) = sinh(w_0 / w_c) exp(-M t / (I w_c)): nearly a
// straight line down to the creep rate at t = I w_0 / M.
TEST(Effects, FrictionStopsAWheel) {
  const double I = 0.5, M = 2.0, w0 = 5.0, creep = 0.1;
  const Model model = ModelFrom(WheelScene(fmt::format(
      "theta_rate = {}\n[joint.axle.friction]\nmoment = {}\ncreep_rate = {}\n", w0, M, creep)));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> w = run["axle.theta_rate"], moment = run["axle.friction_moment"];
  for (std::size_t i = 0; i < w.size(); ++i) {
    const double expected =
        creep * std::asinh(std::sinh(w0 / creep) * std::exp(-M * run.t[i] / (I * creep)));
    EXPECT_NEAR(w[i], expected, kClosedForm * w0);
    EXPECT_NEAR(moment[i], -M * std::tanh(w[i] / creep), 1e-12);
  }
  // The stop: the straight line's end, I w_0 / M = 1.25 s.
  const double slow = w[static_cast<std::size_t>(1.25 * 200)];
  EXPECT_LT(slow, creep);
  EXPECT_GT(w[static_cast<std::size_t>(1.20 * 200)], creep);
  EXPECT_NEAR(run["energy.dissipated_dampers"].back(), 0.5 * I * w0 * w0, 1e-6);
}

// I dw/dt = -c |w| w gives w = w_0 / (1 + c |w_0| t / I), and theta its integral, either way round.
TEST(Effects, QuadraticDamperSlowsAWheel) {
  const double I = 0.5, c = 0.4;
  for (const double w0 : {5.0, -3.0}) {
    const Model model = ModelFrom(WheelScene(
        fmt::format("theta_rate = {}\n[joint.axle.quadratic_damper]\ndamping = {}\n", w0, c)));
    Sampled run(model);
    RunTight(model, 2.0, &run);
    const std::vector<double> theta = run["axle.theta"], w = run["axle.theta_rate"];
    const std::vector<double> moment = run["axle.quadratic_damper_moment"];
    const std::vector<double> lost = run["energy.dissipated_dampers"];
    for (std::size_t i = 0; i < w.size(); ++i) {
      const double slowed = 1.0 + c * std::fabs(w0) * run.t[i] / I;
      const double expected = w0 / slowed;
      EXPECT_NEAR(w[i], expected, kClosedForm * std::fabs(w0));
      EXPECT_NEAR(theta[i], std::copysign(I / c * std::log(slowed), w0), kClosedForm);
      EXPECT_NEAR(moment[i], -c * std::fabs(expected) * expected, kClosedForm * c * w0 * w0);
      EXPECT_NEAR(lost[i], 0.5 * I * (w0 * w0 - expected * expected), kClosedForm * I * w0 * w0);
    }
  }
}

// A block falls onto its speed of m g = c v^2: v = v_t tanh(g t / v_t), the travel v_t^2 / g ln
// cosh.
TEST(Effects, QuadraticDamperHoldsAFallAtItsSpeed) {
  const double m = 2.0, g = 9.81, c = 3.0, limit = std::sqrt(m * g / c);
  const Model model = ModelFrom(BlockScene(fmt::format(
      "[joint.slide.quadratic_damper]\ndamping = {}\n[gravity]\nacceleration = [{}, 0.0]\n", c,
      g)));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> x = run["block.x"], v = run["slide.travel_rate"];
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double phase = g * run.t[i] / limit;
    EXPECT_NEAR(v[i], limit * std::tanh(phase), kClosedForm * limit);
    EXPECT_NEAR(x[i], limit * limit / g * std::log(std::cosh(phase)), kClosedForm);
  }
  EXPECT_LT(run.residual, kClosedForm * m * g);
}

// I dw/dt = M sin(p t).
TEST(Effects, MotorTurnsAWheel) {
  const double I = 0.5, M = 3.0, p = 4.0;
  const Model model = ModelFrom(WheelScene("[joint.axle.motor]\nmoment = '3 * sin(4 * t)'\n"));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> w = run["axle.theta_rate"], theta = run["axle.theta"];
  const std::vector<double> work = run["energy.work"];
  for (std::size_t i = 0; i < w.size(); ++i) {
    const double t = run.t[i], expected = M / (I * p) * (1 - std::cos(p * t));
    EXPECT_NEAR(w[i], expected, kClosedForm);
    EXPECT_NEAR(theta[i], M / (I * p) * (t - std::sin(p * t) / p), kClosedForm);
    EXPECT_NEAR(work[i], 0.5 * I * expected * expected, kClosedForm);
  }
}

TEST(Effects, ConstantForceDoesForceTimesWay) {
  const Model model = ModelFrom(FreeScene("[force.f]\non = 'box'\nforce = [3.0, -4.0]\n"));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> x = run["box.x"], y = run["box.y"], work = run["energy.work"];
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double s = 0.5 * run.t[i] * run.t[i] / 2.0;
    EXPECT_NEAR(x[i], 3.0 * s, kClosedForm);
    EXPECT_NEAR(y[i], -4.0 * s, kClosedForm);
    EXPECT_NEAR(work[i], 25.0 * s, kClosedForm * 25.0);
  }
}

// A force along the axis of a body that spins at w: m x'' = F cos(w t), m y'' = F sin(w t).
TEST(Effects, ForcesFollowTheirBody) {
  const double F = 5.0, w = 3.0, m = 2.0;
  const Model model = ModelFrom(FreeScene(
      "velocity = [0, 0, 3.0]\n[force.f]\non = 'box'\nforce = [5.0, 0]\nframe = 'body'\n"));
  Sampled run(model);
  RunTight(model, 2.0, &run);
  const std::vector<double> x = run["box.x"], y = run["box.y"];
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double t = run.t[i], a = F / (m * w * w);
    EXPECT_NEAR(x[i], a * (1 - std::cos(w * t)), kClosedForm);
    EXPECT_NEAR(y[i], a * (w * t - std::sin(w * t)), kClosedForm);
  }
}

TEST(Effects, OffCentreForceAndTorqueTurn) {
  // A force at (0, 0.2) in a body that a torque keeps from turning: F x r is -0.2 F_x.
  const Model model =
      ModelFrom(FreeScene("[force.f]\non = 'box'\npoint = [0.0, 0.2]\nforce = [3.0, "
                          "0]\n[force.turn]\non = 'box'\ntorque = 0.6\n"));
  Sampled run(model);
  RunTight(model, 1.0, &run);
  EXPECT_NEAR(run["box.theta"].back(), 0.0, 1e-15);
  EXPECT_NEAR(run["box.x"].back(), 0.75, kClosedForm);
}

// The same forces as gravity, segment by segment.
TEST(Effects, LoadPerLengthLikeWeightMovesLikeWeight) {
  const std::string rod = "[weld.root]\ninner = 'ground'\nouter = 'rod.start'\n";
  const std::string base =
      "[scene]\nname = 's'\nduration = 1.0\n[beam.rod]\nlength = 0.8\nmass = 0.4\nEI = 5.0\n"
      "segments = 4\n[mark.tip]\non = 'rod.end'\n";
  const Model weight = ModelFrom(base + rod + "[gravity]\nacceleration = [0.0, -9.81]\n");
  const Model load = ModelFrom(base + rod + "[force.q]\non = 'rod'\nper_length = [0.0, -4.905]\n");
  Sampled a(weight), b(load);
  RunTight(weight, 0.3, &a);
  RunTight(load, 0.3, &b);
  const std::vector<double> ya = a["tip.y"], yb = b["tip.y"];
  EXPECT_LT(*std::min_element(ya.begin(), ya.end()), -0.02);
  for (std::size_t i = 0; i < ya.size(); ++i) EXPECT_NEAR(ya[i], yb[i], kClosedForm);
}

// A free beam pushed where two of its segments meet, off its middle: force and moment about the
// origin change its momenta, whatever the bending does.
TEST(Effects, ForcesInsideABeamChangeItsMomenta) {
  const Model model = ModelFrom(
      "[scene]\nname = 's'\nduration = 1.0\n[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\n"
      "segments = 4\n[force.f]\non = 'rod'\nat = 0.25\nforce = [0.5, 3.0]\n[mark.m]\non = 'rod'\n"
      "at = 0.25\n");
  Sampled run(model);
  RunTight(model, 0.2, &run);
  const std::vector<double> px = run["momentum.x"], py = run["momentum.y"],
                            angular = run["momentum.angular"], x = run["m.x"], y = run["m.y"];
  double moment = 0.0;  // by Simpson's rule over the samples
  constexpr double h = 0.005, kRule = 1e-6;
  for (std::size_t i = 0; i < px.size(); ++i) {
    EXPECT_NEAR(px[i], 0.5 * run.t[i], kClosedForm);
    EXPECT_NEAR(py[i], 3.0 * run.t[i], kClosedForm);
    const auto at = [&](std::size_t k) { return x[k] * 3.0 - y[k] * 0.5; };
    if (i % 2 == 1 || i == 0) continue;
    moment += h / 3 * (at(i - 2) + 4 * at(i - 1) + at(i));
    EXPECT_NEAR(angular[i], moment, kRule);
  }
  EXPECT_GT(angular.back(), 0.1);
  EXPECT_LT(run.residual, kClosedForm * 10.0);
}

// A couple M on the end of a cantilever bends it to a circle. Without a half element at the end the
// last half segment would not bend, and halving the segments would only halve the error.
TEST(Effects, ATorqueOnABeamsEndBendsAllOfIt) {
  double last = 0.0;
  for (const int n : {4, 8}) {
    // The material damps the high modes, a far dashpot on the tip the lowest.
    const Model model = ModelFrom(BeamScene("clamped", n, "damping = 0.002\n") +
                                  "[force.m]\non = 'rod.end'\ntorque = 4.0\n"
                                  "[spring.dashpot]\na = 'ground'\na_point = [1.0, -50.0]\n"
                                  "b = 'rod.end'\ndamping = 3.0\n");
    Sampled run(model);
    SimulateOptions options;
    options.duration = 4.0;
    options.rate = 10.0;
    const SimulateReport report = Simulate(model, options, &run);
    ASSERT_TRUE(report.Usable()) << report.message;
    const std::vector<double> x = run["tip.x"], y = run["tip.y"];
    EXPECT_NEAR(y.back(), y[y.size() - 5], 1e-6);  // at rest
    // From clamp to tip of an arc of radius EI / M = 2.5 m and length 1 m.
    const double error =
        std::hypot(x.back() - 2.5 * std::sin(0.4), y.back() - 2.5 * (1 - std::cos(0.4)));
    if (last > 0.0) {
      EXPECT_GT(std::log2(last / error), 1.8);
      EXPECT_LT(std::log2(last / error), 2.2);
    }
    last = error;
  }
}

// A bar on a pin, tied to the ground by a spring from its end: one degree of freedom, written down
// by hand and integrated by the classical Runge-Kutta method.
TEST(Effects, PendulumOnALinearSpring) {
  const double m = 2.0, r = 0.5, I = 0.1 + m * r * r, k = 80.0, d0 = 0.4, c = 1.5, g = 9.81;
  const double ax = 0.3, ay = -1.3;
  const Model model = ModelFrom(
      PendulumScene(0.8) + fmt::format("[spring.tie]\na = 'ground'\na_point = [{}, {}]\nb = 'bar'\n"
                                       "b_point = [{}, 0]\nstiffness = {}\ndamping = {}\n"
                                       "free_length = {}\n",
                                       ax, ay, r, k, c, d0));
  Sampled run(model);
  RunTight(model, 1.0, &run);
  const auto rate = [&](std::array<double, 2> s) {
    // theta from the downward vertical; the tip at 2 r.
    const double x = 2 * r * std::sin(s[0]), y = -2 * r * std::cos(s[0]);
    const double tx = 2 * r * std::cos(s[0]), ty = 2 * r * std::sin(s[0]);  // d(tip)/d(theta)
    const double dx = x - ax, dy = y - ay, d = std::hypot(dx, dy);
    const double along = (dx * tx + dy * ty) / d;
    const double tension = k * (d - d0) + c * along * s[1];
    return std::array<double, 2>{s[1], (-m * g * r * std::sin(s[0]) - tension * along) / I};
  };
  std::array<double, 2> s{0.8, 0.0};
  constexpr int kParts = 50;  // of a sample's 5 ms; Runge-Kutta's error there is 1e-13
  const double h = 0.005 / kParts;
  const std::vector<double> theta = run["pivot.theta"], length = run["tie.length"];
  for (std::size_t i = 0; i < theta.size(); ++i) {
    EXPECT_NEAR(theta[i], s[0], kClosedForm) << run.t[i];
    EXPECT_NEAR(length[i], std::hypot(2 * r * std::sin(s[0]) - ax, -2 * r * std::cos(s[0]) - ay),
                kClosedForm);
    for (int part = 0; part < kParts; ++part) {
      const auto at = [&](double f, const std::array<double, 2>& q) {
        return std::array<double, 2>{s[0] + f * q[0], s[1] + f * q[1]};
      };
      const auto k1 = rate(s), k2 = rate(at(h / 2, k1)), k3 = rate(at(h / 2, k2)),
                 k4 = rate(at(h, k3));
      for (int j = 0; j < 2; ++j) s[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
  }
  EXPECT_LT(run.residual, 1e-8);
}

TEST(Effects, FreeLengthIsTheDistanceAtTheStartUnlessGiven) {
  const Model model = ModelFrom(PendulumScene(0.0) +
                                "[spring.tie]\na = 'ground'\na_point = [0.4, -1.0]\nb = 'bar'\n"
                                "b_point = [0.5, 0]\nstiffness = 80.0\n");
  Sampled run(model);
  RunTight(model, 0.2, &run);
  EXPECT_NEAR(run["tie.length"].front(), 0.4, 1e-15);
  EXPECT_NEAR(run["tie.tension"].front(), 0.0, 1e-12);
  EXPECT_NEAR(run["pivot.theta"].back(), 0.0, kClosedForm);  // hanging, with a spring at rest
}

TEST(Effects, EnergyBalances) {
  const Model model = ModelFrom(EverythingScene());
  Sampled run(model);
  SimulateOptions options;
  options.rtol = 1e-9;
  ASSERT_TRUE(Simulate(model, options, &run).Usable());
  EXPECT_GT(std::fabs(run["energy.work"].back()), 0.1);
  EXPECT_GT(run["energy.dissipated_dampers"].back(), 0.1);
  // Some thousand steps, each within the tolerance of energies of some J.
  EXPECT_LT(run.residual, 1e-7);
}

TEST(Effects, WhatIsNotInTheSceneIsNotCounted) {
  std::vector<std::string> names;
  for (const auto& e : ModelFrom(PendulumScene(0.1)).Effects()) names.push_back(e.name);
  EXPECT_THAT(names, testing::ElementsAre("bodies", "gravity", "constraints"));
  names.clear();
  for (const auto& e : ModelFrom(EverythingScene()).Effects()) names.push_back(e.name);
  for (const char* name :
       {"dampers", "moment tables", "friction", "motors", "linear springs", "forces"}) {
    EXPECT_THAT(names, testing::Contains(name));
  }
}

// The scene ends before the pole, the run does not.
TEST(Effects, ARunThatMeetsAPoleNamesTheExpression) {
  const Model model = ModelFrom(
      "[scene]\nname = 's'\nduration = 0.2\n[body.wheel]\nmass = 1.0\ninertia = 1.0\n"
      "[joint.axle]\ninner = 'ground'\nouter = 'wheel'\n"
      "[joint.axle.motor]\nmoment = '1 / (t - 0.3) ^ 2'\n");
  Sampled run(model);
  SimulateOptions options;
  options.duration = 1.0;
  const SimulateReport report = Simulate(model, options, &run);
  EXPECT_FALSE(report.Usable());
  EXPECT_NEAR(report.t_end, 0.3, 1e-6);
  EXPECT_THAT(report.message,
              HasSubstr("\"1 / (t - 0.3) ^ 2\" (test.toml:11:joint.axle.motor.moment)"));
  EXPECT_THAT(report.message, HasSubstr("at t = 0.3"));
  EXPECT_GT(run.rows.size(), 50u);  // the results so far are kept
}

}  // namespace
}  // namespace unfurl::sim::effects_test
