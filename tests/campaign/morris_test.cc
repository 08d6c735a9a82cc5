#include "campaign/statistics/morris.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/campaign/coverage.h"
#include "tests/campaign/functions.h"

namespace unfurl::campaign::morris_test {
namespace {

// The function of Morris (1991), section 3.2: twenty inputs, of which 1 to 7 have non-linear or
// interacting effects, 8 to 10 linear ones, and the rest next to none; its random coefficients
// taken as zero.
double Morris1991(std::span<const double> u) {
  std::vector<double> w(20);
  for (int i = 0; i < 20; ++i) {
    const bool bent = i == 2 || i == 4 || i == 6;
    w[i] = bent ? 2.0 * (1.1 * u[i] / (u[i] + 0.1) - 0.5) : 2.0 * (u[i] - 0.5);
  }
  double y = 0.0;
  for (int i = 0; i < 10; ++i) y += 20.0 * w[i];
  for (int i = 0; i < 6; ++i) {
    for (int j = i + 1; j < 6; ++j) y -= 15.0 * w[i] * w[j];
  }
  for (int i = 0; i < 5; ++i) {
    for (int j = i + 1; j < 5; ++j) {
      for (int k = j + 1; k < 5; ++k) y -= 10.0 * w[i] * w[j] * w[k];
    }
  }
  return y + 5.0 * w[0] * w[1] * w[2] * w[3];
}

TEST(ScreenMorrisTest, FindsThePublishedClasses) {
  const Design design({.kind = DesignKind::kMorris, .runs = 21 * 40, .dimensions = 20});
  const MorrisScreening s = ScreenMorris(design, RunAll(design, Morris1991));
  ASSERT_TRUE(s.usable);
  EXPECT_EQ(s.trajectories, 40u);
  for (int k = 0; k < 20; ++k) {
    const MorrisEffect& e = s.inputs[static_cast<std::size_t>(k)];
    EXPECT_EQ(e.n, 40u);
    if (k >= 10) {
      EXPECT_EQ(e.mu_star, 0.0);
      EXPECT_GT(e.rank, 10);
    } else if (k >= 7) {  // linear: slope 40, no scatter
      EXPECT_NEAR(e.mu, 40.0, 1e-9);
      EXPECT_NEAR(e.sigma, 0.0, 1e-9);
    } else {
      EXPECT_GT(e.sigma, 5.0) << k;
    }
  }
}

// Effects of a quadratic and an interaction have closed forms over the design's levels: for u^2
// the effect is u + u', which is 0.75 or 1.25 (four levels), each with probability 1/2.
TEST(ScreenMorrisTest, EqualsClosedFormsWithinItsErrors) {
  constexpr int kRepeats = 200;
  int mu = 0, sigma = 0;
  for (std::uint64_t seed = 1; seed <= kRepeats; ++seed) {
    const Design design(
        {.kind = DesignKind::kMorris, .runs = 3 * 30, .seed = seed, .dimensions = 2});
    const MorrisScreening s = ScreenMorris(
        design, RunAll(design, [](std::span<const double> u) { return u[0] * u[0] - 4 * u[1]; }));
    EXPECT_EQ(s.inputs[1].mu, -4.0);
    EXPECT_EQ(s.inputs[1].mu_star, 4.0);
    EXPECT_EQ(s.inputs[1].rank, 1);
    mu += std::abs(s.inputs[0].mu - 1.0) < 2 * s.inputs[0].mu_error;
    sigma += std::abs(s.inputs[0].sigma - 0.25) < 0.02;
  }
  EXPECT_NEAR(1.0 * mu / kRepeats, 0.954,
              ShareError(0.954, kRepeats) + 0.02);  // a binomial's steps
  EXPECT_GT(sigma, 0.9 * kRepeats);
}

TEST(ScreenMorrisTest, KeepsWhatFailedRunsLeave) {
  const Design design({.kind = DesignKind::kMorris, .runs = 21 * 10, .dimensions = 20});
  std::vector<double> values = RunAll(design, Morris1991);
  values[30] = std::nan("");  // inside a trajectory: two effects
  const MorrisScreening s = ScreenMorris(design, values);
  EXPECT_EQ(s.dropped, 2u);
  EXPECT_TRUE(s.usable);
  for (std::size_t i = 0; i < values.size(); i += 2) values[i] = std::nan("");
  const MorrisScreening none = ScreenMorris(design, values);
  EXPECT_FALSE(none.usable);
  EXPECT_THAT(none.notes.at(0), testing::HasSubstr("its runs failed"));
  EXPECT_FALSE(ScreenMorris(design, std::span<const double>(values).first(42)).usable);
  const Design other({.kind = DesignKind::kRandom, .runs = 210, .dimensions = 20});
  EXPECT_THROW(ScreenMorris(other, values), Error);
}

}  // namespace
}  // namespace unfurl::campaign::morris_test
