#include "base/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace unfurl::statistics_test {
namespace {

TEST(Statistics, QuantilesEqualPrintedTables) {
  EXPECT_NEAR(ChiSquareQuantile(0.95, 1), 3.841, 5e-4);
  EXPECT_NEAR(ChiSquareQuantile(0.95, 10), 18.307, 5e-4);
  EXPECT_NEAR(NormalQuantile(0.975), 1.95996, 5e-6);
  EXPECT_NEAR(StudentQuantile(0.975, 5), 2.571, 5e-4);
  EXPECT_NEAR(ChiSquareTail(18.307, 10), 0.05, 5e-6);
  EXPECT_EQ(ChiSquareTail(std::numeric_limits<double>::infinity(), 10), 0.0);
}

TEST(Statistics, SeveralTestsShareALevel) {
  // By hand: 1 - 0.9^2 = 0.19, and back.
  EXPECT_NEAR(ChanceOfAny(0.1, 2.0), 0.19, 1e-15);
  EXPECT_NEAR(ChanceOfEach(0.19, 2.0), 0.1, 1e-15);
  // Chances far below round-off add up.
  EXPECT_NEAR(ChanceOfAny(1e-30, 250.0) / 250e-30, 1.0, 1e-12);
  EXPECT_EQ(ChanceOfAny(0.0, 3.0), 0.0);
  EXPECT_NEAR(ChanceOfEach(0.01, 0.0), 0.01, 1e-15);  // none was made
}

TEST(Statistics, ClopperPearsonEqualsItsClosedFormAtTheEnds) {
  // With no success in n trials the upper end solves (1 - p)^n = 0.025.
  EXPECT_NEAR(BinomialInterval(0, 20).second, 1.0 - std::pow(0.025, 1.0 / 20), 1e-12);
  EXPECT_EQ(BinomialInterval(0, 20).first, 0.0);
  EXPECT_NEAR(BinomialInterval(20, 20).first, std::pow(0.025, 1.0 / 20), 1e-12);
  EXPECT_EQ(BinomialInterval(20, 20).second, 1.0);
}

TEST(Statistics, MomentsOfAShortList) {
  const std::vector<double> x = {4.0, 1.0, 3.0, 2.0};
  EXPECT_DOUBLE_EQ(Mean(x), 2.5);
  EXPECT_DOUBLE_EQ(Variance(x), 5.0 / 3.0);
  EXPECT_DOUBLE_EQ(Rms(x), std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(Median(x), 2.5);
  EXPECT_DOUBLE_EQ(Quantile(x, 1.0), 4.0);
  EXPECT_NEAR(RobustSigma(x), 1.4826, 1e-4);  // deviations 1.5, 1.5, 0.5, 0.5: median 1
}

}  // namespace
}  // namespace unfurl::statistics_test
