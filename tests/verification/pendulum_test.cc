// The rigid pendulum. Source: its equation theta'' = -w0^2 sin(theta), w0^2 = m g r / I.
// Quantity: angle and rate over ten swings, and the period. Reference: closed form, by Jacobi's
// elliptic functions (Boost.Math). Tolerance: ten times the solver's, times what the motion itself
// makes of an error at the start (its condition, from the closed form). Not checked: friction, a
// flexible rod (conservation_test.cc, flexible_pendulum_test.cc).
#include <gtest/gtest.h>

#include <boost/math/special_functions/ellint_1.hpp>
#include <boost/math/special_functions/jacobi_elliptic.hpp>
#include <cmath>

#include "runs.h"

namespace unfurl::sim::pendulum_test {
namespace {

constexpr double kMass = 2.0, kInertia = 0.1, kArm = 0.5, kGravity = 9.81;
const double kOmega0 = std::sqrt(kMass * kGravity * kArm / (kInertia + kMass * kArm * kArm));

Model Pendulum(double theta) {
  data::Scene scene = data::ParseScene(
      "[scene]\nname = \"pendulum\"\nduration = 5.0\n"
      "[body.bar]\nmass = 2.0\ninertia = 0.1\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.5, 0.0]\n"
      "zero_angle = -1.5707963267948966\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n",
      "pendulum.toml");
  scene.joints[0].theta = theta;
  return Compile(scene);
}

// sin(theta / 2) = k sn(K - w0 t; k): at rest at theta0 when t = 0. The angle, or its rate.
double Exact(double theta0, double t, int derivative) {
  const double k = std::sin(theta0 / 2), K = boost::math::ellint_1(k);
  double cn = 0.0, dn = 0.0;
  const double sn = boost::math::jacobi_elliptic(k, K - kOmega0 * t, &cn, &dn);
  return derivative == 0 ? 2.0 * std::asin(k * sn) : -2.0 * k * kOmega0 * cn;
}

class Swing : public ::testing::TestWithParam<double> {};

TEST_P(Swing, AngleOverTenPeriods) {
  const double theta0 = GetParam(), k = std::sin(theta0 / 2), K = boost::math::ellint_1(k);
  const double period = 4.0 * K / kOmega0;
  for (const double rtol : {1e-6, 1e-9}) {
    SimulateOptions options;
    options.rtol = rtol;
    options.duration = 10.0 * period;
    options.rate = 37.0 / period;  // all phases
    const Recorder run = Record(Pendulum(theta0), options);
    std::vector<double> exact, rate;
    double condition = 1.0;  // largest d(theta) / d(theta0)
    for (const double t : run.t) {
      exact.push_back(Exact(theta0, t, 0));
      rate.push_back(Exact(theta0, t, 1));
      const double h = 1e-6;
      condition = std::max(
          condition, std::fabs(Exact(theta0 + h, t, 0) - Exact(theta0 - h, t, 0)) / (2.0 * h));
    }
    const std::string name = "from " + std::to_string(theta0).substr(0, 4) + " rad, rtol " +
                             (rtol < 1e-8 ? "1e-9" : "1e-6");
    ExpectWithin("pendulum's angle, " + name, LargestDifference(run["pivot.theta"], exact),
                 10.0 * rtol * condition);
    ExpectWithin("pendulum's rate, " + name, LargestDifference(run["pivot.theta_rate"], rate),
                 10.0 * rtol * condition * 2.0 * k * kOmega0);
  }
}
INSTANTIATE_TEST_SUITE_P(Amplitudes, Swing, ::testing::Values(0.3, 1.5, 2.5));

}  // namespace
}  // namespace unfurl::sim::pendulum_test
