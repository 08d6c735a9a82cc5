#include "data/rounded_stamps.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/random.h"

namespace unfurl::data::rounded_stamps_test {
namespace {

std::vector<double> Grid(double start, double step, int n) {
  std::vector<double> t;
  for (int i = 0; i < n; ++i) t.push_back(start + step * i);
  return t;
}

double Worst(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::fabs(a[i] - b[i]));
  return worst;
}

TEST(RoundedStamps, ARateOfFewDigitsIsFoundInItsStep) {
  for (const double rate : {300.0, 7.0, 1500.0, 12345.0, 0.3, 44100.0, 59.94}) {
    const double written = std::stod(fmt::format("{:.5E}", 1.0 / rate));
    EXPECT_NEAR(UnroundedStep(written, RoundingOfE5(written)) * rate, 1.0, 1e-14) << rate;
  }
  // Steps of few digits are what they are, others are left alone.
  EXPECT_EQ(UnroundedStep(0.0125, RoundingOfE5(0.0125)), 0.0125);
  EXPECT_EQ(UnroundedStep(3.14159e-3, 0.0), 3.14159e-3);
}

TEST(RoundedStamps, GridsComeBack) {
  // 300 Hz over a minute: the last digit of 12.3456 s is 0.1 ms, of 1 ms decimals 1 ms.
  const std::vector<double> truth = Grid(0.0, 1.0 / 300.0, 18000);
  std::vector<double> e5, single, decimals;
  for (const double t : truth) {
    e5.push_back(std::stod(fmt::format("{:.5E}", t)));
    single.push_back(static_cast<float>(t));
    decimals.push_back(std::stod(fmt::format("{:.3f}", t)));
  }
  RestoreGrid(&e5, RoundingOfE5);
  RestoreGrid(&single, RoundingOfFloat);
  RestoreDecimals(&decimals);
  for (const auto* t : {&e5, &single, &decimals}) EXPECT_LT(Worst(*t, truth), 1e-12);
}

// Of a rate that has no few digits the grid is known as well as all of its stamps together say.
TEST(RoundedStamps, AnOddGridIsKnownByAllOfItsStamps) {
  const std::vector<double> truth = Grid(0.41273, 0.0033719846, 5000);
  std::vector<double> t;
  for (const double x : truth) t.push_back(std::stod(fmt::format("{:.4f}", x)));
  ASSERT_GT(Worst(t, truth), 4e-5);
  RestoreDecimals(&t);
  EXPECT_LT(Worst(t, truth), 1e-5);
}

TEST(RoundedStamps, WhatIsNoGridIsLeftAlone) {
  Rng rng(3);
  std::vector<double> jitter = Grid(0.0, 0.01, 500), gap = Grid(0.0, 1.0 / 300.0, 500);
  for (double& t : jitter) t = std::stod(fmt::format("{:.4f}", t + 0.001 * rng.Normal()));
  for (std::size_t i = 250; i < gap.size(); ++i) gap[i] += 0.5 / 300.0;
  // A stamp a second, of what came every 0.7 to 1.3 s.
  std::vector<double> coarse;
  for (int i = 0; i < 40; ++i) coarse.push_back(std::round(i + 0.3 * rng.Uniform(-1.0, 1.0)));
  for (std::vector<double> t : {jitter, gap, coarse, {}, {1.0}, {1.0, 2.0}, {0.0, 1.0, 3.0, 4.0}}) {
    const std::vector<double> before = t;
    RestoreDecimals(&t);
    EXPECT_EQ(t, before);
    RestoreGrid(&t, RoundingOfE5);
    EXPECT_EQ(t, before);
  }
}

}  // namespace
}  // namespace unfurl::data::rounded_stamps_test
