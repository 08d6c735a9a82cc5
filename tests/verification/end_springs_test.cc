// Beams with torsion springs on their own ends. Source: Euler and Bernoulli's beam with a spring of
// stiffness k at its pinned end, the other free:
//   (k L / EI) (1 + cos b cosh b) = b (sin b cosh b - cos b sinh b),   omega = b^2 sqrt(EI / (m
//   L^3));
// and two beams pinned in series to the ground, a preloaded spring at each pin, let go folded.
// Quantity: the first three frequencies; the tip's path over 1 s. Reference: roots of the equation;
// the path's own refinement. Tolerance: second order in the segments, from both sides. Not checked:
// the path against another formulation (smooth_beams_test.cc).
#include <gtest/gtest.h>

#include <cmath>

#include "linearized.h"
#include "runs.h"

namespace unfurl::sim {
namespace {

double Characteristic(double b, double K) {  // over cosh b
  return K * (1.0 / std::cosh(b) + std::cos(b)) - b * (std::sin(b) - std::cos(b) * std::tanh(b));
}

// The n-th root, counted from 1, by the changes of sign.
double Root(int n, double K) {
  constexpr double kStep = 0.01;
  for (double b = kStep;; b += kStep) {
    if (Characteristic(b, K) * Characteristic(b + kStep, K) > 0.0 || --n > 0) continue;
    double low = b, high = b + kStep;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (Characteristic(low, K) * Characteristic(middle, K) > 0.0 ? low : high) = middle;
    }
    return low;
  }
}

TEST(EndSprings, FrequenciesAreOfSecondOrder) {
  constexpr double kRatio = 2.0;                           // k L / EI
  EXPECT_NEAR(Root(1, 1e9), 1.87510406871196, 1e-6);       // clamped
  EXPECT_NEAR(Root(1, 1e-6), std::pow(3e-6, 0.25), 1e-4);  // a rigid bar on its spring
  std::vector<std::vector<double>> error;
  for (const int n : {12, 24, 48}) {
    const std::vector<double> found = TransverseFrequencies(
        Compile(data::ParseScene("[scene]\nname = \"beam\"\nduration = 1.0\n"
                                 "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = " +
                                     std::to_string(n) +
                                     "\n"
                                     "[joint.pin]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                                     "[joint.pin.spring]\nstiffness = 20.0\n",
                                 "beam.toml")));
    std::vector<double> at;
    for (int k = 0; k < 3; ++k) {
      const double b = Root(k + 1, kRatio);
      at.push_back(found[k] / (b * b * std::sqrt(10.0)) - 1.0);
    }
    error.push_back(at);
  }
  for (int mode = 0; mode < 3; ++mode) {
    for (int k = 0; k < 2; ++k) {
      const double order = std::log2(error[k][mode] / error[k + 1][mode]);
      std::printf("found: spring on a beam's end, mode %d: relative error %.2e, order %.3f\n",
                  mode + 1, error[k + 1][mode], order);
      EXPECT_GT(order, 1.85) << mode;
      EXPECT_LT(order, 2.15) << mode;
    }
  }
}

std::string TwoBeams(int segments) {
  const auto beam = [&](const std::string& name) {
    return "[beam." + name + "]\nlength = 0.8\nmass = 0.424\nEI = 18.69\nEA = 1.35e7\nsegments = " +
           std::to_string(segments) + "\n";
  };
  return "[scene]\nname = \"two beams\"\nduration = 1.0\n" + beam("one") + beam("two") +
         "[joint.a]\ninner = \"ground\"\nouter = \"one.start\"\ntheta = 1.5707963267948966\n"
         "[joint.a.spring]\nstiffness = 0.218\npreload = 1.57\n"
         "[joint.b]\ninner = \"one.end\"\nouter = \"two.start\"\nsign = -1\n"
         "theta = 3.141592653589793\n"
         "[joint.b.spring]\nstiffness = 0.218\npreload = 1.57\n"
         "[mark.tip]\non = \"two.end\"\n";
}

TEST(EndSprings, TwoBeamsInSeriesConvergeInSecondOrder) {
  std::vector<Recorder> runs;
  for (const int n : {8, 16, 32}) {
    SimulateOptions options;
    options.rtol = 1e-7;
    runs.push_back(Record(Compile(data::ParseScene(TwoBeams(n), "two_beams.toml")), options));
  }
  double distance[2];
  for (int k = 0; k < 2; ++k) {
    distance[k] = std::hypot(RootMeanSquareDifference(runs[k]["tip.x"], runs[k + 1]["tip.x"]),
                             RootMeanSquareDifference(runs[k]["tip.y"], runs[k + 1]["tip.y"]));
  }
  const double order = std::log2(distance[0] / distance[1]);
  std::printf(
      "found: two beams in series, n = 8 to 16: %.3f mm RMS, 16 to 32: %.3f mm, order %.3f\n",
      1e3 * distance[0], 1e3 * distance[1], order);
  EXPECT_GT(order,
            1.7);  // the springs' sudden release rings high modes, whose phases cost some order
  EXPECT_LT(order, 2.3);
}

}  // namespace
}  // namespace unfurl::sim
