#include "sim/methods/crossing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/random.h"

namespace unfurl::sim::crossing_test {
namespace {

// scale * product of (s - root).
DensePolynomial FromRoots(const std::vector<double>& roots, double scale) {
  DensePolynomial p{{scale}, 1};
  for (const double r : roots) {
    for (int k = p.count; k > 0; --k) p.c[k] = p.c[k - 1] - r * p.c[k];
    p.c[0] *= -r;
    ++p.count;
  }
  return p;
}

constexpr double kNear = 1e-9;  // of roots some hundredths apart, in the monomials' rounding

TEST(Crossing, FindsTheFirstOfMany) {
  Rng rng(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const int n = 1 + static_cast<int>(rng.Uniform() * 7.0);
    std::vector<double> roots;
    for (int k = 0; k < n; ++k) roots.push_back(-0.5 + 2.0 * rng.Uniform());
    std::sort(roots.begin(), roots.end());
    bool crowded = false;
    for (int k = 1; k < n; ++k) crowded |= roots[k] - roots[k - 1] < 0.03;
    for (const double r : roots) crowded |= std::fabs(r) < 0.03 || std::fabs(r - 1.0) < 0.03;
    if (crowded) continue;
    const DensePolynomial p = FromRoots(roots, rng.Uniform() < 0.5 ? 1.0 : -1.0);
    // The first root inside at which p turns positive.
    double expected = -1.0;
    for (const double r : roots) {
      if (expected < 0.0 && r > 0.0 && r < 1.0 && p.Slope(r) > 0.0) expected = r;
    }
    const bool above = p.c[0] > 0.0;
    const double found = FirstUpcrossing(p, above);
    EXPECT_NEAR(found, expected, kNear);
    EXPECT_TRUE(expected < 0.0 || MayRise(p, 0.0));
  }
}

TEST(Crossing, TwoRootsTooNearForTheEndsToShow) {
  const DensePolynomial p = FromRoots({0.5, 0.5 + 1e-5}, -1.0);
  EXPECT_NEAR(FirstAbove(p, 0.0), 0.5, 1e-10);
  EXPECT_LT(FirstAbove(FromRoots({0.5, 0.5}, -1.0), 0.0), 0.0);  // a touch from below
}

TEST(Crossing, JustCrossedIsNotCrossedAgain) {
  const DensePolynomial rising{{-1e-17, 1.0}, 2};  // crossed, and yet below by rounding
  EXPECT_LT(FirstUpcrossing(rising, true), 0.0);
  EXPECT_NEAR(FirstUpcrossing(rising, false), 0.0, 1e-15);
  // Up by rounding, down through a half, up again at 0.9.
  DensePolynomial again = FromRoots({1e-17, 0.5, 0.9}, 1.0);
  EXPECT_NEAR(FirstUpcrossing(again, true), 0.9, kNear);
}

TEST(Crossing, MayRiseRulesOutWhatIsFarOrFalling) {
  EXPECT_FALSE(MayRise({{-1.0, 0.5}, 2}, 0.1));
  EXPECT_TRUE(MayRise({{-1.0, 0.95}, 2}, 0.1));
  EXPECT_FALSE(MayRise({{1e-17, -0.5}, 2}, 0.1));  // falling away from the level
  EXPECT_TRUE(MayRise({{1e-17, -0.05}, 2}, 0.1));
}

}  // namespace
}  // namespace unfurl::sim::crossing_test
