// Natural frequencies of uniform beams made of segments. Source: Euler and Bernoulli's beam.
// Quantity: the first three frequencies of cantilever, free-free and pinned-pinned beams.
// Reference: roots of the characteristic equations. Tolerance: the order of convergence is 2.0 from
// both sides for the first two (interior lumping alone is left: (l^2 / 24) int(v v'') / int(v^2),
// itself held to 2%), 1.9 (to two digits) from n = 16 on for the pinned one. Not checked: shear and
// section rotary inertia, which the model leaves out.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "linearized.h"
#include "runs.h"

namespace unfurl::sim::beam_frequencies_test {
namespace {

// A 1 m, 1 kg beam along x with EI = 10 N m^2; the pinned one stretches (EA), else its two pins and
// the longitudinal constraints would repeat one another.
Model Beam(const std::string& ends, int segments) {
  std::string text =
      "[scene]\nname = \"beam\"\nduration = 1.0\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = " +
      std::to_string(segments) + "\n";
  if (ends == "clamped") text += "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n";
  if (ends == "pinned") {
    text +=
        "axial = \"elastic\"\nEA = 1e4\n"
        "[joint.left]\ninner = \"ground\"\nouter = \"rod.start\"\n"
        "[joint.right]\ninner = \"ground\"\ninner_point = [1.0, 0.0]\nouter = \"rod.end\"\n";
  }
  return Compile(data::ParseScene(text, "beam.toml"));
}

// Roots beta L of the characteristic equations.
constexpr double kCantilever[3] = {1.87510406871196, 4.69409113297418, 7.85475743823761};
constexpr double kFreeFree[3] = {4.73004074486270, 7.85320462409584, 10.9956078380017};
constexpr double kPinned[3] = {M_PI, 2 * M_PI, 3 * M_PI};

void ExpectOrder(const std::string& ends, const double* roots, const std::vector<int>& meshes,
                 double low, double high) {
  std::vector<std::vector<double>> error;
  for (const int n : meshes) {
    const std::vector<double> found = TransverseFrequencies(Beam(ends, n));
    std::vector<double> at;
    for (int k = 0; k < 3; ++k)
      at.push_back(found[k] / (roots[k] * roots[k] * std::sqrt(10.0)) - 1);
    error.push_back(at);
  }
  for (int mode = 0; mode < 3; ++mode) {
    std::printf("found: %-8s mode %d  relative errors", ends.c_str(), mode + 1);
    for (std::size_t k = 0; k < error.size(); ++k) {
      std::printf("  n = %d: %.2e", meshes[k], error[k][mode]);
      if (k == 0) continue;
      const double order = std::log(error[k - 1][mode] / error[k][mode]) /
                           std::log(static_cast<double>(meshes[k]) / meshes[k - 1]);
      std::printf(" (order %.3f)", order);
      EXPECT_GT(order, low) << ends << " mode " << mode + 1;
      EXPECT_LT(order, high) << ends << " mode " << mode + 1;
    }
    std::printf("\n");
  }
}

// Higher terms of the order: a few (l k)^2, below 0.05 from n = 12.
TEST(BeamFrequencies, CantileverIsOfSecondOrder) {
  ExpectOrder("clamped", kCantilever, {12, 24, 48}, 1.93, 2.07);
}
TEST(BeamFrequencies, FreeFreeIsOfSecondOrder) {
  ExpectOrder("free", kFreeFree, {12, 24, 48}, 1.93, 2.07);
}
// The rigid outer half segments leave a term of third order: 1.89 to 1.90 between 16 and 32, 1.95
// between 32 and 64.
constexpr double kLow = 1.885;
TEST(BeamFrequencies, PinnedReachesSecondOrderFromSixteen) {
  ExpectOrder("pinned", kPinned, {16, 32, 64}, kLow, 2.1);
}

TEST(BeamFrequencies, RemainingErrorIsTheInteriorLumping) {
  const double k = kFreeFree[0], l = 1.0 / 48;
  const double sigma = (std::cosh(k) - std::cos(k)) / (std::sinh(k) - std::sin(k));
  double vv = 0.0, vc = 0.0;
  constexpr int kPoints = 4000;
  for (int i = 0; i < kPoints; ++i) {
    const double x = k * (i + 0.5) / kPoints;
    const double v = std::cosh(x) + std::cos(x) - sigma * (std::sinh(x) + std::sin(x));
    const double c = k * k * (std::cosh(x) - std::cos(x) - sigma * (std::sinh(x) - std::sin(x)));
    vv += v * v;
    vc += v * c;
  }
  const double expected = l * l / 24.0 * vc / vv;
  const double found = TransverseFrequencies(Beam("free", 48))[0] / (k * k * std::sqrt(10.0)) - 1.0;
  ExpectWithin("free-free beam's error against (l^2/24) int(v v'')/int(v^2)",
               std::fabs(found / expected - 1.0), 0.02);
}

}  // namespace
}  // namespace unfurl::sim::beam_frequencies_test
