#include "sim/dynamics/trigonometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace unfurl::sim::trigonometry_test {
namespace {

// Two units in the last place of numbers near 1.
constexpr double kTolerance = 4.5e-16;

TEST(SinCos, AgreesWithTheStandardFunctions) {
  Rng rng(1);
  constexpr int kCount = 4096;
  std::vector<double> theta(kCount), s(kCount), c(kCount);
  for (const double range : {1e-9, 1.0, 10.0, 1e4}) {
    for (double& t : theta) t = rng.Uniform(-range, range);
    SinCos(theta.data(), kCount, s.data(), c.data());
    for (int i = 0; i < kCount; ++i) {
      EXPECT_NEAR(s[i], std::sin(theta[i]), kTolerance) << theta[i];
      EXPECT_NEAR(c[i], std::cos(theta[i]), kTolerance) << theta[i];
    }
  }
}

TEST(SinCos, QuadrantsAndSigns) {
  const std::vector<double> theta = {0.0,   M_PI_2,     M_PI,     -M_PI_2,
                                     -M_PI, 1.5 * M_PI, 2 * M_PI, M_PI_4};
  std::vector<double> s(8), c(8);
  SinCos(theta.data(), 8, s.data(), c.data());
  for (int i = 0; i < 8; ++i) {
    EXPECT_NEAR(s[i], std::sin(theta[i]), kTolerance);
    EXPECT_NEAR(c[i], std::cos(theta[i]), kTolerance);
  }
}

}  // namespace
}  // namespace unfurl::sim::trigonometry_test
