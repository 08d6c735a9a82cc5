// The cantilever of data/sets/cantilever, let go under gravity. Source: Euler and Bernoulli's beam.
// Quantity: the tip's motion. Reference: the sum of its modes,
//   w(L, t) = g sum_n (2 sigma_n / beta_n) 2 (-1)^(n+1) (1 - cos(omega_n t)) / omega_n^2,
// sigma_n = (cosh + cos) / (sinh + sin) at beta_n; gravity is made a thousandth, since that is
// linear theory. Tolerance: second order in the segments, from both sides. Not checked: large
// deflections (elastica_test.cc, flexible_pendulum_test.cc).
#include <gtest/gtest.h>

#include <cmath>

#include "runs.h"

namespace unfurl::sim::cantilever_test {
namespace {

constexpr double kGravity = 9.81e-3;

// Roots of cosh(b) cos(b) = -1: near (n - 1/2) pi.
double Root(int n) {
  double b = n == 1 ? 1.875 : (n - 0.5) * M_PI;
  for (int k = 0; k < 20; ++k) {
    const double f = std::cos(b) + 1.0 / std::cosh(b);
    b -= f / (-std::sin(b) - std::tanh(b) / std::cosh(b));
  }
  return b;
}

double TipAt(double t) {
  double sum = 0.0;
  for (int n = 1; n <= 12; ++n) {
    const double b = Root(n), w = b * b * 10.0;  // sqrt(EI / (m L^3)) = 10
    const double e = std::exp(-b);  // hyperbolic functions times e^-b, to keep them small
    const double sigma =
        (0.5 * (1 + e * e) + e * std::cos(b)) / (0.5 * (1 - e * e) + e * std::sin(b));
    sum += 4.0 * sigma / b * (n % 2 == 1 ? 1.0 : -1.0) * (1.0 - std::cos(w * t)) / (w * w);
  }
  return -kGravity * sum;
}

TEST(Cantilever, TipMovesAsTheSumOfItsModes) {
  EXPECT_NEAR(Root(1), 1.87510406871196, 1e-12);
  double error[2];
  for (const int fine : {0, 1}) {
    data::Scene scene = ReadSet("cantilever/scene.toml");
    scene.beams[0].segments = fine ? 48 : 24;
    scene.gravity->acceleration = {0.0, -kGravity};
    SimulateOptions options;
    options.rtol = 1e-10;
    options.duration = 0.5;
    const Recorder run = Record(Compile(scene), options);
    std::vector<double> exact;
    for (const double t : run.t) exact.push_back(TipAt(t));
    const double sag = kGravity / 800.0;  // m g L^3 / (8 EI)
    error[fine] = RootMeanSquareDifference(run["tip.y"], exact) / sag;
  }
  const double order = std::log2(error[0] / error[1]);
  std::printf("found: cantilever, order in the segments %.3f\n", order);
  EXPECT_GT(order, 1.85);
  EXPECT_LT(order, 2.15);
  ExpectWithin("cantilever, 48 segments, tip over the static sag, RMS", error[1], 1e-3);
}

}  // namespace
}  // namespace unfurl::sim::cantilever_test
