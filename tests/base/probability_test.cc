#include "base/probability.h"

#include <gtest/gtest.h>

#include <cmath>

namespace unfurl::probability_test {
namespace {

TEST(Probability, NormalEqualsPrintedTables) {
  EXPECT_NEAR(NormalCdf(1.96), 0.97500, 5e-6);
  EXPECT_NEAR(NormalCdf(-3.0), 1.349898e-3, 5e-10);
  EXPECT_NEAR(NormalCdf(-10.0), 7.619853e-24, 5e-30);  // [Abramowitz and Stegun, table 26.2]
}

TEST(Probability, BinomialEqualsItsSum) {
  for (const double p : {0.0, 0.001, 0.3, 0.97, 1.0}) {
    double sum = 0.0, term = 1.0;
    for (int k = 0; k <= 12; ++k) {
      term = std::tgamma(13) / (std::tgamma(k + 1) * std::tgamma(13 - k)) * std::pow(p, k) *
             std::pow(1 - p, 12 - k);
      sum += term;
      EXPECT_NEAR(BinomialCdf(static_cast<std::size_t>(k), 12, p), sum, 1e-13) << k << " " << p;
    }
  }
}

}  // namespace
}  // namespace unfurl::probability_test
