// Where `auto` turns to the implicit method, against the limits of docs/decisions/012-implicit.md.

#include "sim/methods/choose_method.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/sim/scenes.h"

namespace unfurl::sim::choose_method_test {
namespace {

constexpr int kSegments = 8;

constexpr double kMass = 1.0 / kSegments;  // of a segment [kg]

// The highest bending rate of BeamScene's rod (1 m, 1 kg, EI = 10 N m^2): 4.6 sqrt(12 EI / (l^3
// m)), m the mass of a segment. [1/s]
double BendingRate() {
  const double l = 1.0 / kSegments;
  return 4.6 * std::sqrt(12.0 * 10.0 / (l * l * l * kMass));
}

Method Chosen(const std::string& start, const std::string& beam, double rtol, int order = 0) {
  SimulateOptions options;
  options.method = Method::kAuto;
  options.rtol = rtol;
  options.order = order;
  return ChooseMethod(options, ModelFrom(BeamScene(start, kSegments, beam)));
}

// beta omega beyond 2.5 at 1e-3, 4.4 at 1e-4, 7.9 at 1e-5: 2.5 (rtol / 1e-3)^(-1/4).
TEST(ChooseMethod, TurnsImplicitWhereDampingIsStiff) {
  const double omega = BendingRate();
  const struct {
    double rtol, limit;
  } cases[] = {{1e-3, 2.5}, {1e-4, 2.5 * std::pow(10.0, 0.25)}, {1e-5, 2.5 * std::sqrt(10.0)}};
  for (const auto& [rtol, limit] : cases) {
    const auto with = [&, at = rtol](double overdamped) {
      return Chosen("free", fmt::format("damping = {:.17g}\n", overdamped / omega), at);
    };
    EXPECT_EQ(with(0.99 * limit), Method::kProjected) << rtol;
    EXPECT_EQ(with(1.01 * limit), Method::kImplicit) << rtol;
  }
}

// The axial rate 2 sqrt(EA / (l m)) beyond four bending rates.
TEST(ChooseMethod, TurnsImplicitWhereStretchingIsStiff) {
  const double l = 1.0 / kSegments;
  const auto with = [&](double ratio) {
    const double rate = ratio * BendingRate();
    return Chosen("free",
                  fmt::format("axial = \"elastic\"\nEA = {:.17g}\n", rate * rate / 4.0 * l * kMass),
                  1e-3);
  };
  EXPECT_EQ(with(3.96), Method::kProjected);
  EXPECT_EQ(with(4.04), Method::kImplicit);
}

TEST(ChooseMethod, StaysExplicitAtFineTolerancesAndWithAnOrder) {
  const std::string stiff = "damping = 1.0\n";
  EXPECT_EQ(Chosen("free", stiff, 1e-7), Method::kImplicit);
  EXPECT_EQ(Chosen("free", stiff, 0.99e-7), Method::kProjected);
  EXPECT_EQ(Chosen("clamped", stiff, 1e-3), Method::kImplicit);
  EXPECT_EQ(Chosen("free", stiff, 1e-3, 5), Method::kProjected);
  EXPECT_EQ(Chosen("free", "", 1e-3), Method::kProjected);
  SimulateOptions options;
  options.method = Method::kPartitioned;
  EXPECT_EQ(ChooseMethod(options, ModelFrom(BeamScene("free", kSegments, stiff))),
            Method::kPartitioned);
}

}  // namespace
}  // namespace unfurl::sim::choose_method_test
