// Beams with torsion springs on their own ends. Source: Euler and Bernoulli's beam with a spring of
// stiffness k at its pinned end, the other free, omega = b^2 sqrt(EI / (m L^3)) with
//   (k L / EI) (1 + cos b cosh b) = b (sin b cosh b - cos b sinh b);
// and two beams pinned in series to the ground, a preloaded spring at each pin, let go folded.
// Quantity: the first three frequencies; the tip's path over 1 s. Reference: roots of the equation;
// the smooth beam, another formulation. Tolerance: second order in the segments. Not checked:
// drives and latches on a beam's own end.
#include <gtest/gtest.h>

#include <cmath>

#include "linearized.h"
#include "runs.h"

namespace unfurl::sim::end_springs_test {
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
  constexpr int kMeshes[] = {24, 48, 96};
  std::vector<std::vector<double>> error;
  for (const int n : kMeshes) {
    const std::vector<double> found =
        TransverseFrequencies(Compile(data::ParseScene("[scene]\nname = \"beam\"\nduration = 1.0\n"
                                                       "[beam.rod]\nlength = 1.0\nmass = 1.0\n"
                                                       "EI = 10.0\nsegments = " +
                                                           std::to_string(n) +
                                                           "\n[joint.pin]\ninner = \"ground\"\n"
                                                           "outer = \"rod.start\"\n"
                                                           "[joint.pin.spring]\nstiffness = 20.0\n",
                                                       "beam.toml")));
    std::vector<double> at;
    for (int k = 0; k < 3; ++k) {
      const double b = Root(k + 1, kRatio);
      at.push_back(found[k] / (b * b * std::sqrt(10.0)) - 1.0);
    }
    error.push_back(at);
  }
  // The end's own little body leaves a term of third order, of the other sign: in the first mode it
  // nearly cancels the second at these meshes, so there only the size is held.
  constexpr double kFirst = 0.05;  // times n^-2
  for (int k = 0; k < 2; ++k) {    // at 96 rounding in the differences shows
    ExpectWithin("spring on a beam's end, mode 1, n = " + std::to_string(kMeshes[k]),
                 std::fabs(error[k][0]), kFirst / (kMeshes[k] * kMeshes[k]));
  }
  for (int mode = 1; mode < 3; ++mode) {
    for (int k = 0; k < 2; ++k) {
      const double order = std::log2(error[k][mode] / error[k + 1][mode]);
      std::printf("found: spring on a beam's end, mode %d: relative error %.2e, order %.3f\n",
                  mode + 1, error[k + 1][mode], order);
      EXPECT_GT(order, 1.85) << mode;
      EXPECT_LT(order, 2.2) << mode;
    }
  }
}

data::Scene TwoBeams(const std::string& model) {
  const auto beam = [&](const std::string& name) {
    return "[beam." + name + "]\nlength = 0.8\nmass = 0.424\nEI = 18.69\n" + model;
  };
  return data::ParseScene(
      "[scene]\nname = \"two beams\"\nduration = 1.0\n" + beam("one") + beam("two") +
          "[joint.a]\ninner = \"ground\"\nouter = \"one.start\"\ntheta = 1.5707963267948966\n"
          "[joint.a.spring]\nstiffness = 0.218\npreload = 1.57\n"
          "[joint.b]\ninner = \"one.end\"\nouter = \"two.start\"\nsign = -1\n"
          "theta = 3.141592653589793\n"
          "[joint.b.spring]\nstiffness = 0.218\npreload = 1.57\n"
          "[mark.tip]\non = \"two.end\"\n",
      "two_beams.toml");
}

// The distance between meshes n and 2 n falls at least as n^-1.8 from n = 6 to n = 8 (without a
// station at the ends it would fall as n^-1; terms of third order make it fall faster here). A
// little damping, since the springs' sudden release rings high modes, whose phases would spoil the
// order.
TEST(EndSprings, TwoBeamsInSeriesConverge) {
  constexpr double kDamping = 1e-4;  // [s]
  std::map<int, Recorder> runs;
  for (const int n : {6, 8, 12, 16}) {
    SimulateOptions options;
    options.rtol = 1e-6;
    data::Scene scene = TwoBeams("segments = " + std::to_string(n) + "\n");
    for (auto& beam : scene.beams) beam.damping = kDamping;
    runs.emplace(n, Record(Compile(scene), options));
  }
  const auto distance = [&](int n) {
    const Recorder &a = runs.at(n), &b = runs.at(2 * n);
    return std::hypot(RootMeanSquareDifference(a["tip.x"], b["tip.x"]),
                      RootMeanSquareDifference(a["tip.y"], b["tip.y"]));
  };
  const double order = std::log(distance(6) / distance(8)) / std::log(8.0 / 6.0);
  std::printf(
      "found: two beams in series: %.3f mm RMS from n = 6 to 12, %.3f from 8 to 16, order %.2f\n",
      1e3 * distance(6), 1e3 * distance(8), order);
  EXPECT_GT(order, 1.8);
  ExpectWithin("two beams in series, n = 8 to 16, tip, RMS [m]", distance(8), 3e-3);
}

}  // namespace
}  // namespace unfurl::sim::end_springs_test
