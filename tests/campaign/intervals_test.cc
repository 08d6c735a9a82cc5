#include "campaign/statistics/intervals.h"

#include <gtest/gtest.h>

#include "base/probability.h"
#include "base/statistics.h"
#include "tests/campaign/coverage.h"

namespace unfurl::campaign::intervals_test {
namespace {

TEST(Wilks, EqualsPublishedNumbersOfRuns) {
  EXPECT_EQ(WilksRuns(0.95, 0.95, 1), 59u);  // [Wilks 1941]; used in nuclear licensing since
  EXPECT_EQ(WilksRuns(0.95, 0.95, 2), 93u);
  EXPECT_EQ(WilksRuns(0.95, 0.95, 1, 1), 93u);
  EXPECT_EQ(WilksRuns(0.95, 0.95, 1, 2), 124u);
  EXPECT_EQ(WilksRuns(0.90, 0.90, 1), 22u);
  EXPECT_EQ(WilksRuns(0.90, 0.95, 2), 46u);
  EXPECT_EQ(WilksRuns(0.99, 0.95, 1), 299u);
  EXPECT_EQ(WilksRuns(0.99, 0.99, 2), 662u);
  EXPECT_EQ(WilksRuns(0.999, 0.95, 1), 2995u);
}

TEST(Wilks, LeavesOutWhatItsNumbersAllow) {
  EXPECT_FALSE(WilksLeftOut(58, 0.95, 0.95, 1));
  EXPECT_EQ(WilksLeftOut(59, 0.95, 0.95, 1), 0u);
  EXPECT_EQ(WilksLeftOut(123, 0.95, 0.95, 1), 1u);
  EXPECT_EQ(WilksLeftOut(124, 0.95, 0.95, 1), 2u);
  EXPECT_FALSE(WilksLeftOut(0, 0.95, 0.95, 2));
}

TEST(QuantileRanks, EqualPublishedOnesOfTheMedian) {
  // Ranks of 95% intervals of the median [Conover 1999; Gibbons and Chakraborti 2011].
  EXPECT_FALSE(QuantileRanks(5, 0.5, 0.95));
  EXPECT_EQ(QuantileRanks(6, 0.5, 0.95), (std::pair<std::size_t, std::size_t>{1, 6}));
  EXPECT_EQ(QuantileRanks(10, 0.5, 0.95), (std::pair<std::size_t, std::size_t>{2, 9}));
  EXPECT_EQ(QuantileRanks(20, 0.5, 0.95), (std::pair<std::size_t, std::size_t>{6, 15}));
  EXPECT_EQ(QuantileRanks(100, 0.5, 0.95), (std::pair<std::size_t, std::size_t>{40, 61}));
}

// The confidence of the ranks, in the other direction: at least what was asked, and less with
// either rank one nearer.
TEST(QuantileRanks, AreTheNarrowestThatHold) {
  for (const std::size_t n : {40, 400, 4000}) {
    for (const double p : {0.1, 0.37, 0.9, 0.99}) {
      const auto ranks = QuantileRanks(n, p, 0.9);
      if (!ranks) {
        EXPECT_GT(std::pow(std::max(p, 1 - p), n), 0.05);
        continue;
      }
      EXPECT_LE(BinomialCdf(ranks->first - 1, n, p), 0.05);
      EXPECT_GT(BinomialCdf(ranks->first, n, p), 0.05);
      EXPECT_GE(BinomialCdf(ranks->second - 1, n, p), 0.95);
      EXPECT_LT(BinomialCdf(ranks->second - 2, n, p), 0.95);
    }
  }
}

TEST(NormalTolerance, EqualsPublishedFactors) {
  // Two-sided factors, 95% of the distribution with 95% confidence [Hahn and Meeker 1991, table
  // A.10b]; Howe's approximation is some parts in a thousand off them.
  EXPECT_NEAR(NormalToleranceFactor(10, 0.95, 0.95), 3.379, 0.006);
  EXPECT_NEAR(NormalToleranceFactor(20, 0.95, 0.95), 2.752, 0.006);
  EXPECT_NEAR(NormalToleranceFactor(100, 0.95, 0.95), 2.233, 0.004);
}

TEST(DistributionBandTest, EqualsItsClosedForm) {
  EXPECT_NEAR(DistributionBand(100, 0.95), 0.1358, 5e-5);  // sqrt(log(40) / 200)
  EXPECT_EQ(DistributionBand(1, 0.95), 1.0);
}

class Coverage : public testing::TestWithParam<Population> {};
INSTANTIATE_TEST_SUITE_P(All, Coverage, testing::ValuesIn(Populations()),
                         [](const auto& the) { return the.param.name; });

// Shares of seeded repeats whose 95% interval holds the truth. The mean's keeps what it says, also
// for skewed values of few runs; sigma's asks for the fourth moment, which few skewed values know
// badly, and the header says how far it falls short.
TEST_P(Coverage, OfMeanAndSigma) {
  constexpr int kRepeats = 2000;
  const Population& population = GetParam();
  const bool skewed = population.name == "exponential" || population.name == "log_normal";
  Rng rng(11);
  for (const int n : {20, 200}) {
    int mean = 0, sigma = 0;
    for (int k = 0; k < kRepeats; ++k) {
      const std::vector<double> x = Draw(population, n, rng);
      const Interval m = MeanInterval(x, 0.95), s = SigmaInterval(x, 0.95);
      mean += m.low <= population.mean && population.mean <= m.high;
      sigma += s.low <= population.sigma && population.sigma <= s.high;
    }
    const double few = n == 20 ? 0.01 : 0.0;  // 20 values know their skewness to 0.5
    EXPECT_NEAR(1.0 * mean / kRepeats, 0.95, few + ShareError(0.95, kRepeats)) << n;
    const double said = !skewed ? 0.94 : n == 20 ? 0.88 : 0.92;
    EXPECT_GT(1.0 * sigma / kRepeats, said - ShareError(said, kRepeats)) << n;
    EXPECT_LT(1.0 * sigma / kRepeats, 0.96 + ShareError(0.96, kRepeats)) << n;
  }
}

// The test of normality rejects 5% of normal samples at 0.05, and sees others.
TEST(Normality, HasItsLevelAndPower) {
  constexpr int kRepeats = 2000;
  Rng rng(4);
  for (const Population& population : Populations()) {
    int rejected = 0;
    for (int k = 0; k < kRepeats; ++k) {
      std::vector<double> x = Draw(population, 60, rng);
      std::sort(x.begin(), x.end());
      rejected += NormalityP(x) < 0.05;
    }
    const double share = 1.0 * rejected / kRepeats;
    if (population.name == "normal") {
      EXPECT_NEAR(share, 0.05, ShareError(0.05, kRepeats) + 0.005);  // the table is of 3 digits
    } else {
      EXPECT_GT(share, 0.6) << population.name;
    }
  }
  EXPECT_EQ(NormalityP(std::vector<double>(20, 1.0)), 0.0);
  EXPECT_EQ(NormalityP(std::vector<double>{1, 2, 3}), 0.0);
}

}  // namespace
}  // namespace unfurl::campaign::intervals_test
