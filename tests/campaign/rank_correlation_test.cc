#include "campaign/statistics/rank_correlation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace unfurl::campaign::rank_correlation_test {
namespace {

TEST(RankCorrelation, OfAnyRisingCurveIsOne) {
  const std::vector<double> x = {3.0, -1.0, 2.0, 0.5}, y = {20.0, 0.1, 7.0, 1.6};
  EXPECT_EQ(RankCorrelation(x, y), 1.0);
  const std::vector<double> down = {-20.0, -0.1, -7.0, -1.6};
  EXPECT_EQ(RankCorrelation(x, down), -1.0);
  EXPECT_EQ(RankCorrelation(x, std::vector<double>(4, 2.0)), 0.0);
}

// Yes and no: ranks 1.5, 1.5, 3.5, 3.5 against 1 to 4, 2 / sqrt(5) by hand.
TEST(RankCorrelation, EqualValuesShareTheirRank) {
  const std::vector<double> x = {1.0, 2.0, 3.0, 4.0}, yes = {0.0, 0.0, 1.0, 1.0};
  EXPECT_NEAR(RankCorrelation(x, yes), 2.0 / std::sqrt(5.0), 1e-15);
}

// Of normal pairs it is 6 / pi asin(rho / 2), and the interval holds that as often as it says.
TEST(RankCorrelation, IntervalsCoverNormalPairs) {
  constexpr int kRepeats = 1500;
  Rng rng(11);
  for (const double rho : {0.0, 0.6, -0.85}) {
    const double truth = 6.0 / M_PI * std::asin(0.5 * rho);
    for (const std::size_t n : {25, 200}) {
      int held = 0;
      for (int repeat = 0; repeat < kRepeats; ++repeat) {
        std::vector<double> a, b;
        for (std::size_t i = 0; i < n; ++i) {
          a.push_back(rng.Normal());
          b.push_back(rho * a.back() + std::sqrt(1.0 - rho * rho) * rng.Normal());
        }
        const Interval i = RankCorrelationInterval(RankCorrelation(a, b), n, 0.95);
        held += i.low <= truth && truth <= i.high ? 1 : 0;
      }
      const double share = static_cast<double>(held) / kRepeats;
      EXPECT_GT(share, 0.93) << rho << " " << n;
      EXPECT_LT(share, 0.98) << rho << " " << n;
    }
  }
}

}  // namespace
}  // namespace unfurl::campaign::rank_correlation_test
