// Implicit steps of scenes with smooth beams, and `auto` where it changes methods while it runs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"
#include "runs.h"
#include "scenes.h"
#include "sim/implicit/esdirk.h"
#include "sim/implicit/kkt_smooth.h"
#include "sim/methods/dormand_prince8.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::implicit_smooth_test {
namespace {

// A free body, two smooth beams with a sprung and damped knee, a body welded to the second one's
// end (so that it is part of the beam), and a beam of segments pinned there.
std::string Chain(double beta, const std::string& more = {}) {
  return fmt::format(
             "[scene]\nname = \"chain\"\nduration = 0.2\n"
             "[body.hub]\nmass = 2.0\ninertia = 0.3\nvelocity = [0.1, -0.2, 0.7]\n"
             "[body.tip]\nmass = 0.2\ninertia = 0.004\n"
             "[beam.one]\nlength = 0.8\nmass = 0.4\nEI = 18.0\nmodel = \"kirchhoff\"\norder = 2\n"
             "damping = {0:g}\n"
             "[beam.two]\nlength = 0.6\nmass = 0.3\nEI = 12.0\nmodel = \"kirchhoff\"\norder = 3\n"
             "damping = {0:g}\n"
             "[beam.three]\nlength = 0.5\nmass = 0.2\nEI = 6.0\nsegments = 2\n"
             "[joint.root]\ninner = \"hub\"\ninner_point = [0.2, 0.1]\nouter = \"one.start\"\n"
             "theta = 0.4\n[joint.root.spring]\nstiffness = 3.0\npreload = 0.5\n"
             "[joint.knee]\ninner = \"one.end\"\nouter = \"two.start\"\ntheta = 0.9\n"
             "[joint.knee.spring]\nstiffness = 2.0\n[joint.knee.damper]\ndamping = 0.05\n"
             "[weld.tip]\ninner = \"two.end\"\nouter = \"tip\"\nouter_point = [-0.05, 0.02]\n"
             "[joint.last]\ninner = \"tip\"\ninner_point = [0.05, 0.0]\nouter = \"three.start\"\n"
             "theta = -0.7\n"
             "[mark.end]\non = \"three.end\"\n",
             beta) +
         more;
}

// A state in the midst of a motion: positions a little off, rates at random.
std::vector<double> Moved(const Model& model, Dynamics* dynamics, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<double> y = model.initial_state, rate(y.size() + kBlock);
  y.resize(y.size() + kBlock);
  const int n = model.rigid_bodies.count;
  for (int s = 0; s < n; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) y[d * n + s] += 0.02 * rng.Normal();
    for (int d = 3; d < 6; ++d) y[d * n + s] = rng.Normal();
  }
  // Places for three amplitudes to a body, of which the last may have fewer.
  for (int b = 0; b < model.kirchhoff.count(); ++b) {
    const KirchhoffBeams::Beam& beam = model.kirchhoff.beam(b);
    for (int k = beam.rod.amplitudes(); k < 3 * beam.amplitude_bodies(); ++k) {
      const int at = k % 3 * n + beam.first_amplitude() + k / 3;
      y[at] = y[3 * n + at] = 0.0;
    }
  }
  dynamics->RightSide(0.0, y.data(), rate.data());
  return y;
}

// v^T M v / 2 of the matrix that a step uses is the kinetic energy that the balance knows, by
// another sum.
TEST(SmoothSaddle, MassMatrixHoldsTheKineticEnergy) {
  const Model model = ModelFrom(Chain(1e-4));
  Dynamics dynamics(model);
  for (std::uint64_t seed : {1, 2, 3}) {
    std::vector<double> y = Moved(model, &dynamics, seed);
    Tangent tangent;
    const Array lambda = dynamics.constraint_work().lambda;
    dynamics.FillTangent(0.0, y.data(), lambda.data(), &tangent);
    SmoothSaddle saddle(model.rigid_bodies, model.kirchhoff, model.constraints, tangent);
    saddle.Linearise(model.kirchhoff, dynamics.constraint_work().smooth_work);
    const int n = model.rigid_bodies.count;
    std::vector<double> w(y.begin() + 3 * n, y.begin() + 6 * n);
    saddle.MassTimes(w.data());
    double twice = 0.0;
    for (int k = 0; k < 3 * n; ++k) twice += w[k] * y[3 * n + k];
    const double kinetic = dynamics.BalanceAt(0.0, y.data()).kinetic;
    EXPECT_NEAR(0.5 * twice, kinetic, 1e-12 * kinetic);
  }
}

// Without the tangent a solve is what a force does at once: against the right side's own solution,
// which goes through compliances and a Schur complement. The force is that of gravity, turned on
// and off; sums of some tens of terms over a Schur complement of condition 1e4.
TEST(SmoothSaddle, SolvesAsTheRightSideDoes) {
  const Model without = ModelFrom(Chain(1e-4));
  const Model with = ModelFrom(Chain(1e-4, "[gravity]\nacceleration = [1.3, -9.81]\n"));
  Dynamics a(without), b(with);
  std::vector<double> y = Moved(without, &a, 5), rate_a(y.size()), rate_b(y.size());
  a.RightSide(0.0, y.data(), rate_a.data());
  b.RightSide(0.0, y.data(), rate_b.data());
  a.RightSide(0.0, y.data(), rate_a.data());
  Tangent tangent;
  const Array lambda = a.constraint_work().lambda;
  a.FillTangent(0.0, y.data(), lambda.data(), &tangent);
  SmoothSaddle saddle(without.rigid_bodies, without.kirchhoff, without.constraints, tangent);
  saddle.Linearise(without.kirchhoff, a.constraint_work().smooth_work);
  std::vector<double> J(6 * without.constraints.rows() + kBlock);
  a.Jacobian(0.0, y.data(), J.data());
  saddle.Factor(tangent, J.data(), 0.0, 0.0);
  // Gravity's generalized force is M times the same acceleration everywhere.
  const int n = without.rigid_bodies.count;
  std::vector<double> x(3 * n, 0.0), g(without.constraints.rows(), 0.0);
  for (int s = 0; s < n; ++s) {
    const bool centre = without.rigid_bodies.inverse_mass[s] > 0.0;
    x[s] = centre ? 1.3 : 0.0;
    x[n + s] = centre ? -9.81 : 0.0;
  }
  saddle.MassTimes(x.data());
  saddle.Solve(x.data(), g.data());
  for (int s = 0; s < n; ++s) {
    if (!without.rigid_bodies.IsDynamic(s)) continue;
    for (int d = 0; d < 3; ++d) {
      const int k = d * n + s;
      EXPECT_NEAR(x[k], rate_b[3 * n + k] - rate_a[3 * n + k], 1e-9) << s << " " << d;
    }
  }
}

// What the tangent leaves out costs no order; a mass matrix or Jacobian that is not that of the
// right side would.
TEST(EsdirkOnSmoothBeams, FourthOrder) {
  const Model model = ModelFrom(Chain(1e-4));
  constexpr double kEnd = 0.02;
  ErrorScale scale;
  scale.rtol = kAnyError;
  Dynamics dynamics(model);
  DormandPrince8 reference(dynamics, scale);
  const std::vector<double> exact = Fixed(&reference, model, kEnd, 2000);
  scale.rtol = 1e-11;  // stages are solved far below the errors that show the order
  Esdirk stepper(dynamics, scale, Ark436());
  double error[3] = {};
  for (int k = 0; k < 3; ++k) {
    const std::vector<double> y = Fixed(&stepper, model, kEnd, 800 << k);
    const int n = model.rigid_bodies.count;
    for (int s = 0; s < n; ++s) {
      if (!model.rigid_bodies.IsDynamic(s)) continue;
      for (int d = 0; d < 3; ++d) {
        error[k] = std::max(error[k], std::fabs(y[d * n + s] - exact[d * n + s]));
      }
    }
  }
  for (int k = 0; k < 2; ++k) {
    const double order = std::log2(error[k] / error[k + 1]);
    EXPECT_GT(order, 3.7) << error[k] << " " << error[k + 1];
    EXPECT_LT(order, 4.4);
  }
}

MarkTracks MarksOf(const Model& model, Method method, double rtol) {
  SimulateOptions options;
  options.method = method;
  options.rtol = rtol;
  options.rate = 200.0;
  return SimulateMarks(model, options);
}

// Damping of 1 ms makes the smooth beams' highest shapes decay at some 1e7 per second, which binds
// explicit steps; the implicit method, and `auto`, take hundreds of times fewer.
TEST(AutoSwitches, DampedSmoothBeams) {
  const Model model = ModelFrom(Chain(1e-3));
  for (const double rtol : {1e-4, 1e-6}) {
    const MarkTracks chosen = MarksOf(model, Method::kAuto, rtol);
    const MarkTracks implicit = MarksOf(model, Method::kImplicit, rtol);
    const MarkTracks reference = MarksOf(model, Method::kImplicit, 1e-9);
    ASSERT_TRUE(chosen.report.Usable()) << chosen.report.message;
    ASSERT_TRUE(implicit.report.Usable()) << implicit.report.message;
    EXPECT_LT(FarthestApart(chosen, reference), 10.0 * rtol * model.length_scale);
    EXPECT_LT(FarthestApart(implicit, reference), 10.0 * rtol * model.length_scale);
    EXPECT_NE(chosen.report.method.find("diagonally implicit"), std::string::npos)
        << chosen.report.method;
    // A first window and trial beside, of some thousand right sides.
    EXPECT_LT(chosen.report.evaluations, 2 * implicit.report.evaluations + 2500);
  }
}

// Segments with a damping of 1 s: an explicit run would take hours. Through a loop, too.
TEST(AutoSwitches, OverdampedSegmentsInALoop) {
  const Model model = ModelFrom(
      "[scene]\nname = \"four-bar\"\nduration = 0.5\n"
      "[body.crank]\nmass = 1.0\ninertia = 0.1\n[body.rocker]\nmass = 1.0\ninertia = 0.1\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 8\ndamping = 1.0\n"
      "[joint.a]\ninner = \"ground\"\nouter = \"crank\"\n"
      "outer_point = [-0.2, 0.0]\ntheta = 1.2\n"
      "[joint.b]\ninner = \"crank\"\ninner_point = [0.2, 0.0]\nouter = \"rod.start\"\n"
      "theta = -1.1\n"
      "[joint.c]\ninner = \"rod.end\"\nouter = \"rocker\"\n"
      "outer_point = [-0.4, 0.0]\ntheta = -1.4\n"
      "[joint.d]\ninner = \"ground\"\ninner_point = [1.1, 0.0]\nouter = \"rocker\"\n"
      "outer_point = [0.4, 0.0]\ntheta = -1.3\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n[mark.end]\non = \"rod.end\"\n");
  constexpr double kRtol = 1e-6;
  const MarkTracks chosen = MarksOf(model, Method::kAuto, kRtol);
  ASSERT_TRUE(chosen.report.Usable()) << chosen.report.message;
  EXPECT_LT(chosen.report.evaluations, 100'000);
  const MarkTracks reference = MarksOf(model, Method::kImplicit, 1e-8);
  EXPECT_LT(FarthestApart(chosen, reference), 10.0 * kRtol * model.length_scale);
}

// Stretching that is stiff and undamped: the edge of stability along the imaginary axis. Against
// explicit steps that follow every vibration. Where it is so stiff that the implicit steps lose
// their order, the energy's balance shows it and the run says so.
TEST(AutoSwitches, StiffStretching) {
  const auto scene = [](double EA) {
    return ModelFrom(fmt::format(
        "[scene]\nname = \"swing\"\nduration = 0.3\n"
        "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 200.0\nsegments = 4\ndamping = 1e-4\n"
        "axial = \"elastic\"\nEA = {}\n"
        "[joint.pivot]\ninner = \"ground\"\nouter = \"rod.start\"\ntheta = 0.3\n"
        "[gravity]\nacceleration = [0.0, -9.81]\n[mark.end]\non = \"rod.end\"\n",
        EA));
  };
  constexpr double kRtol = 1e-6;
  for (const double EA : {1e6, 1e9}) {
    const Model model = scene(EA);
    const MarkTracks implicit = MarksOf(model, Method::kImplicit, kRtol);
    SimulateOptions options;
    options.rtol = kRtol;
    options.rate = 200.0;
    SimulateReport report = Simulate(model, options, nullptr);
    ASSERT_TRUE(report.Usable()) << report.message;
    EXPECT_LT(report.evaluations, 2 * implicit.report.evaluations + 2500);
    const MarkTracks chosen = MarksOf(model, Method::kAuto, kRtol);
    const MarkTracks followed = MarksOf(model, Method::kProjected, 1e-8);
    const double off = FarthestApart(chosen, followed) / (kRtol * model.length_scale);
    EXPECT_TRUE(off < 10.0 || !report.warnings.empty()) << EA << " " << off;
    if (EA < 1e7) {
      EXPECT_LT(off, 10.0);
    }
  }
}

// What ends up at rest by dry friction is stiff only then.
TEST(AutoSwitches, FrictionAtRest) {
  const Model model = ModelFrom(
      "[scene]\nname = \"arm\"\nduration = 20.0\n"
      "[body.arm]\nmass = 1.0\ninertia = 0.1\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"arm\"\nouter_point = [-0.5, 0.0]\n"
      "theta_rate = 1.0\n"
      "[joint.pivot.friction]\nmoment = 0.5\ncreep_rate = 1e-6\n[mark.tip]\non = \"arm\"\npoint = "
      "[0.5, 0.0]\n");
  const MarkTracks chosen = MarksOf(model, Method::kAuto, 1e-6);
  ASSERT_TRUE(chosen.report.Usable()) << chosen.report.message;
  EXPECT_LT(chosen.report.evaluations, 100'000);
  // Stopped by M = 0.5 N m: I w^2 / 2 = M theta with I = 0.35 kg m^2 about the pivot, 0.35 rad.
  const double turned = std::atan2(chosen.y[0].back(), chosen.x[0].back());
  EXPECT_NEAR(turned, 0.35, 10.0 * 1e-6);
}

}  // namespace
}  // namespace unfurl::sim::implicit_smooth_test
