// Where `auto` turns to the implicit method, against the limits of docs/decisions/012-implicit.md.

#include "sim/methods/choose_method.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim/methods/make_stepper.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::choose_method_test {
namespace {

constexpr int kSegments = 8;

// At rest another rule holds, the last of these tests.
constexpr char kMoves[] = "velocity = [0.1, 0.0, 0.0]\n";

constexpr double kMass = 1.0 / kSegments;  // of a segment [kg]

// The highest bending rate of BeamScene's rod (1 m, 1 kg, EI = 10 N m^2): 4.6 sqrt(12 EI / (l^3
// m)), m the mass of a segment. [1/s]
double BendingRate() {
  const double l = 1.0 / kSegments;
  return 4.6 * std::sqrt(12.0 * 10.0 / (l * l * l * kMass));
}

// Scaled by the model, as Simulate does it.
Method Of(SimulateOptions options, const std::string& scene) {
  const Model model = ModelFrom(scene);
  options.length = model.length_scale;
  options.time = model.time_scale;
  return ChooseMethod(options, model, ScaleOf(model, options));
}

Method Chosen(const std::string& start, const std::string& beam, double rtol, int order = 0,
              double longest = 0.0) {
  SimulateOptions options;
  options.max_step = longest;
  options.method = Method::kAuto;
  options.rtol = rtol;
  options.order = order;
  return Of(options, BeamScene(start, kSegments, beam));
}

// beta omega beyond 2.5 at 1e-3, 4.4 at 1e-4, 7.9 at 1e-5: 2.5 (rtol / 1e-3)^(-1/4).
TEST(ChooseMethod, TurnsImplicitWhereDampingIsStiff) {
  const double omega = BendingRate();
  const struct {
    double rtol, limit;
  } cases[] = {{1e-3, 2.5}, {1e-4, 2.5 * std::pow(10.0, 0.25)}, {1e-5, 2.5 * std::sqrt(10.0)}};
  for (const auto& [rtol, limit] : cases) {
    const auto with = [&, at = rtol](double overdamped) {
      return Chosen("free", fmt::format("{}damping = {:.17g}\n", kMoves, overdamped / omega), at);
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
    // So fast that strains of the tolerance hold next to nothing of what moves.
    return Chosen("free",
                  fmt::format("axial = \"elastic\"\nEA = {:.17g}\nvelocity = [1e4, 0.0, 0.0]\n",
                              rate * rate / 4.0 * l * kMass),
                  1e-3);
  };
  EXPECT_EQ(with(3.96), Method::kProjected);
  EXPECT_EQ(with(4.04), Method::kImplicit);
}

// Each of the elements EA / l, an eighth of them at the ends not counted, strained by rtol of the
// model's length holds (7 EA / l) (rtol length)^2 / 2; a rod of 1 kg at v has v^2 / 2.
TEST(ChooseMethod, TurnsImplicitWhereStrainsOfTheToleranceHoldMoreThanMoves) {
  constexpr double kEA = 8.0;  // soft: neither damping nor stretching is stiff
  // The stretching rate is 2 sqrt(EA / (l m)) = 45 1/s: such a step reaches the edge of stability.
  constexpr double kLongest = 0.1;  // [s]
  const double length = ModelFrom(BeamScene("free", kSegments)).length_scale;
  for (const double rtol : {1e-3, 1e-6, 1e-9}) {
    const double least = length * std::sqrt((kSegments - 1) * kEA * kSegments * rtol);
    const auto with = [&](double speed) {
      return Chosen(
          "free",
          fmt::format("axial = \"elastic\"\nEA = {}\nvelocity = [{:.17g}, 0.0, 0.0]\n", kEA, speed),
          rtol, 0, kLongest);
    };
    EXPECT_EQ(with(1.01 * least), Method::kProjected) << rtol;
    EXPECT_EQ(with(0.99 * least), Method::kImplicit) << rtol;
  }
  // Where no step comes near that edge explicit ones leave nothing.
  const std::string slow = fmt::format("{}axial = \"elastic\"\nEA = {}\n", kMoves, kEA);
  EXPECT_EQ(Chosen("free", slow, 1e-3, 0, kLongest), Method::kImplicit);
  EXPECT_EQ(Chosen("free", slow, 1e-3, 0, 0.02), Method::kProjected);
}

TEST(ChooseMethod, StaysExplicitAtFineTolerancesAndWithAnOrder) {
  const std::string damped = "damping = 1.0\n", stiff = kMoves + damped;
  EXPECT_EQ(Chosen("free", stiff, 1e-7), Method::kImplicit);
  EXPECT_EQ(Chosen("free", stiff, 0.99e-7), Method::kProjected);
  EXPECT_EQ(Chosen("clamped", damped, 1e-3), Method::kImplicit);
  EXPECT_EQ(Chosen("free", stiff, 1e-3, 5), Method::kProjected);
  EXPECT_EQ(Chosen("free", kMoves, 1e-3), Method::kProjected);
  SimulateOptions options;
  options.method = Method::kPartitioned;
  EXPECT_EQ(Of(options, BeamScene("free", kSegments, stiff)), Method::kPartitioned);
}

// A pendulum that hangs still, but for rounding, and the same a little out of the vertical: g sin
// of the angle, over a time scale and its part of the length, against rtol.
TEST(ChooseMethod, TurnsImplicitWhereNothingMoves) {
  const auto hung = [](double off, double rtol) {
    SimulateOptions options;
    options.rtol = rtol;
    return Of(options,
              fmt::format("[scene]\nname = \"hung\"\nduration = 5.0\n[gravity]\n"
                          "acceleration = [3.0, 4.0]\n[beam.rod]\nlength = 1.0\nmass = 1.0\n"
                          "EI = 10.0\n[joint.pin]\ninner = \"ground\"\nouter = \"rod.start\"\n"
                          "theta = {:.17g}\n",
                          std::atan2(4.0, 3.0) + off));
  };
  for (const double rtol : {1e-3, 1e-6}) {
    EXPECT_EQ(hung(0.0, rtol), Method::kImplicit) << rtol;
    EXPECT_EQ(hung(rtol, rtol), Method::kProjected) << rtol;
    EXPECT_EQ(hung(0.01 * rtol, rtol), Method::kImplicit) << rtol;
  }
}

// Explicit steps at the edge of stability made motion of the rounding, and the balance of energy
// was off by all of it.
TEST(ChooseMethod, WhatHangsStillStaysThere) {
  const Model model = ModelFrom(
      "[scene]\nname = \"hung\"\nduration = 2.0\n[gravity]\nacceleration = [9.05, 3.79]\n"
      "[beam.rod]\nlength = 1.27\nmass = 1.47\nEI = 19.6\n[joint.pin]\ninner = \"ground\"\n"
      "outer = \"rod.start\"\n" +
      fmt::format("theta = {:.17g}\n", std::atan2(3.79, 9.05)));
  for (const double rtol : {1e-4, 1e-5, 1e-6, 1e-7}) {
    SimulateOptions options;
    options.rtol = rtol;
    const SimulateReport report = Simulate(model, options, nullptr);
    EXPECT_TRUE(report.Usable()) << rtol << ": " << report.message;
    EXPECT_LT(report.energy_moved, 1e-12) << rtol;  // [J] of 9 J
  }
}

}  // namespace
}  // namespace unfurl::sim::choose_method_test
