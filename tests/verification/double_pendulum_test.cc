// The double pendulum of data/sets/double_pendulum. Source: Lagrange's equations of two rods.
// Quantity: angles and rates over 5 s; frequencies of small swings. Reference: a second formulation
// in two absolute angles, Fehlberg 7(8) at 1e-14; and for small swings the closed form
//   omega^2 = (g / L) (3 -+ 6 / sqrt(7)).
// Tolerance: named below. Not checked: the motion after chaos has set in.
#include <gtest/gtest.h>

#include <cmath>

#include "angle_tree.h"
#include "reference.h"
#include "runs.h"

namespace unfurl::sim::double_pendulum_test {
namespace {

constexpr double kGravity = 9.81;

reference::AngleTree TwoRods() {
  reference::AngleTree tree(2, false);
  tree.bodies = {{1.0, 1.0 / 12, 0, {0.5, 0.0}}, {1.0, 1.0 / 12, 1, {1.0, 0.5}}};
  tree.load = [](double, const std::vector<double>&, reference::AngleTree::Forces& forces) {
    for (auto& force : forces.on_body) force = {0.0, -kGravity};
  };
  return tree;
}

TEST(DoublePendulum, AgreesWithASecondFormulation) {
  const data::Scene scene = ReadSet("double_pendulum/scene.toml");
  SimulateOptions options;
  options.rtol = 1e-12;
  options.rate = 100.0;
  const Recorder run = Record(Compile(scene), options);
  const reference::AngleTree tree = TwoRods();
  const double upper = -M_PI_2 + scene.joints[0].theta, lower = upper + scene.joints[1].theta;
  reference::Integrator integrator;
  const auto states =
      integrator.Run([&](double t, const auto& y, auto& dydt) { tree.RightSide(t, y, dydt); },
                     {upper, lower, 0.0, 0.0}, reference::EvenTimes(5.0, 500));
  std::vector<double> shoulder, elbow, elbow_rate;
  for (const auto& y : states) {
    shoulder.push_back(y[0] + M_PI_2);
    elbow.push_back(y[1] - y[0]);
    elbow_rate.push_back(y[3] - y[2]);
  }
  // Errors of the steps, 1e-12, grow here some 1e3-fold in 5 s (found with both programs by moving
  // the start).
  ExpectWithin("double pendulum, angle of the shoulder",
               LargestDifference(run["shoulder.theta"], shoulder), 1e-8);
  ExpectWithin("double pendulum, angle of the elbow", LargestDifference(run["elbow.theta"], elbow),
               1e-8);
  ExpectWithin("double pendulum, rate of the elbow",
               LargestDifference(run["elbow.theta_rate"], elbow_rate), 1e-7);
}

// Two equal uniform rods: det(K - w^2 M) = 0 with M = m L^2 [4/3 1/2; 1/2 1/3],
// K = m g L diag(3/2, 1/2): (7/36) z^2 - (7/6) z + 3/4 = 0, z = w^2 L / g = 3 -+ 6/sqrt(7).
TEST(DoublePendulum, SmallSwingsHaveTheFrequenciesOfTheClosedForm) {
  for (const double side : {-1.0, 1.0}) {
    const double z = 3.0 + side * 6.0 / std::sqrt(7.0), w = std::sqrt(z * kGravity);
    // Mode: (3/2 - 4/3 z) a = z/2 b, in absolute angles a, b.
    constexpr double kAmplitude = 1e-5;
    const double ratio = (1.5 - 4.0 / 3.0 * z) / (0.5 * z);
    data::Scene scene = ReadSet("double_pendulum/scene.toml");
    scene.joints[0].theta = kAmplitude;
    scene.joints[1].theta = kAmplitude * (ratio - 1.0);
    SimulateOptions options;
    options.rtol = 1e-13;
    options.rate = 50.0;
    options.duration = 10.0;
    const Recorder run = Record(Compile(scene), options);
    std::vector<double> expected;
    for (const double t : run.t) expected.push_back(kAmplitude * std::cos(w * t));
    // Terms of third order: the frequency changes by amplitude^2 / 16; steps of 1e-13.
    ExpectWithin("double pendulum, small swings of mode " + std::string(side < 0 ? "1" : "2"),
                 LargestDifference(run["shoulder.theta"], expected) / kAmplitude, 1e-6);
  }
}

}  // namespace
}  // namespace unfurl::sim::double_pendulum_test
