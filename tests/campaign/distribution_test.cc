#include "campaign/statistics/distribution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign::distribution_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Case {
  std::string name;
  Distribution distribution;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::vector<Case> Continuous() {
  return {{"normal", Distribution::Normal(-3.0, 0.2)},
          {"uniform", Distribution::Uniform(-1e6, -0.9e6)},
          {"log_normal", Distribution::LogNormal(2.5e-4, 1.7)},
          {"log_uniform", Distribution::LogUniform(1e-3, 10.0)},
          {"log_uniform_narrow", Distribution::LogUniform(1.0, 1.001)},
          {"triangular", Distribution::Triangular(1.0, 1.2, 3.0)},
          {"triangular_at_end", Distribution::Triangular(0.0, 0.0, 1.0)},
          {"empirical", Distribution::Empirical({3.0, 1.0, 2.0, 10.0})},
          {"normal_cut", Distribution::Normal(0.0, 1.0).Truncated(-1.0, 0.5)},
          {"normal_tail", Distribution::Normal(0.0, 1.0).Truncated(8.0, kInfinity)},
          {"log_normal_cut", Distribution::LogNormal(1.0, 2.0).Truncated(0.1, 1.5)},
          {"triangular_cut", Distribution::Triangular(0.0, 1.0, 4.0).Truncated(0.5, 3.0)},
          {"empirical_cut", Distribution::Empirical({3.0, 1.0, 2.0, 10.0}).Truncated(1.5, 4.0)}};
}

class OfContinuous : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(All, OfContinuous, testing::ValuesIn(Continuous()),
                         [](const auto& the) { return the.param.name; });

TEST_P(OfContinuous, QuantileInvertsTheCdf) {
  const Distribution& distribution = GetParam().distribution;
  double last = -kInfinity;
  for (const double u : {1e-12, 1e-9, 1e-6, 0.001, 0.1, 0.3, 0.5, 0.7, 0.9, 0.999, 1.0 - 1e-9}) {
    const double x = distribution.Quantile(u);
    EXPECT_GE(x, last);
    last = x;
    // An x has 53 bits, and a probability no more than the density lets it: both enter.
    const double slope = std::abs(distribution.Cdf(x * (1 + 1e-12)) - distribution.Cdf(x));
    EXPECT_NEAR(distribution.Cdf(x), u, 1e-11 * u + 1e-14 + slope) << u;
  }
}

// Mean and standard deviation by the midpoint rule on the quantile: a second formulation.
TEST_P(OfContinuous, MomentsAreThoseOfItsQuantile) {
  const Distribution& distribution = GetParam().distribution;
  constexpr int kN = 400000;
  const double middle = distribution.Quantile(0.5);
  double first = 0.0, second = 0.0;
  for (int i = 0; i < kN; ++i) {
    const double x = distribution.Quantile((i + 0.5) / kN) - middle;
    first += x / kN;
    second += x * x / kN;
  }
  // The rule misses what lies beyond the outermost points of an infinite tail: some 1e-5 of sigma.
  const double sigma = std::sqrt(second - first * first);
  EXPECT_NEAR(distribution.Mean(), middle + first, 2e-5 * sigma);
  EXPECT_NEAR(distribution.Sigma(), sigma, 1e-4 * sigma);
}

TEST(Distribution, TailsOfTheNormalEqualPublishedValues) {
  const Distribution normal = Distribution::Normal(0.0, 1.0);
  EXPECT_NEAR(normal.Quantile(1e-12), -7.034483825, 1e-9);  // [Wichura 1988 and tables]
  EXPECT_NEAR(normal.Quantile(1e-6), -4.753424309, 1e-9);
  EXPECT_NEAR(normal.Quantile(0.975), 1.959963984540, 1e-12);
  // Beyond 8 sigma the mean is Mills' ratio inverted: phi(8) / Phi(-8) = 8.12136...
  const Distribution tail = normal.Truncated(8.0, kInfinity);
  const double density = std::exp(-32.0) / std::sqrt(2.0 * std::numbers::pi);
  const double beyond = 0.5 * std::erfc(8.0 / std::numbers::sqrt2);
  EXPECT_NEAR(tail.Mean(), density / beyond, 1e-10);
  const double h = density / beyond;
  EXPECT_NEAR(tail.Sigma(), std::sqrt(1.0 - h * (h - 8.0)), 1e-9);
  // The same mirrored.
  const Distribution low = normal.Truncated(-kInfinity, -8.0);
  EXPECT_NEAR(low.Mean(), -tail.Mean(), 1e-12);
  EXPECT_NEAR(low.Quantile(0.25), -tail.Quantile(0.75), 1e-12);
}

TEST(Distribution, MomentsEqualClosedForms) {
  const Distribution log_normal = Distribution::LogNormal(2.0, std::exp(0.5));
  EXPECT_NEAR(log_normal.Mean(), 2.0 * std::exp(0.125), 1e-12);
  EXPECT_NEAR(log_normal.Sigma(), 2.0 * std::exp(0.125) * std::sqrt(std::exp(0.25) - 1.0), 1e-12);
  const Distribution log_uniform = Distribution::LogUniform(1.0, 100.0);
  const double mean = 99.0 / std::log(100.0);
  EXPECT_NEAR(log_uniform.Mean(), mean, 1e-10);
  EXPECT_NEAR(log_uniform.Sigma(), std::sqrt(9999.0 / (2 * std::log(100.0)) - mean * mean), 1e-10);
  const Distribution triangular = Distribution::Triangular(0.0, 1.0, 4.0);
  EXPECT_NEAR(triangular.Mean(), 5.0 / 3.0, 1e-14);
  EXPECT_NEAR(triangular.Sigma(), std::sqrt((16.0 + 1.0 - 4.0) / 18.0), 1e-14);
  // Truncation of a uniform is a uniform.
  const Distribution cut = Distribution::Uniform(0.0, 10.0).Truncated(2.0, 5.0);
  EXPECT_NEAR(cut.Mean(), 3.5, 1e-12);
  EXPECT_NEAR(cut.Sigma(), 3.0 / std::sqrt(12.0), 1e-10);
}

TEST(Distribution, ATableGivesItsValuesWithTheirWeights) {
  const Distribution table = Distribution::Table({3.0, 1.0, 3.0, 7.0}, {1.0, 2.0, 1.0, 0.0});
  EXPECT_EQ(table.Quantile(0.5), 1.0);
  EXPECT_EQ(table.Quantile(0.500001), 3.0);
  EXPECT_EQ(table.Quantile(1.0), 3.0);
  EXPECT_EQ(table.Cdf(2.9), 0.5);
  EXPECT_EQ(table.Mean(), 2.0);
  EXPECT_EQ(table.Sigma(), 1.0);
  const Distribution cut = Distribution::Table({1.0, 2.0, 3.0}).Truncated(1.5, 9.0);
  EXPECT_EQ(cut.Quantile(0.4), 2.0);
  EXPECT_EQ(cut.Quantile(0.6), 3.0);
}

TEST(Distribution, OfSamplesWithTiesKeepsTheirShare) {
  const Distribution e = Distribution::Empirical({1.0, 2.0, 2.0, 2.0, 3.0});
  EXPECT_EQ(e.Quantile(0.3), 2.0);
  EXPECT_EQ(e.Quantile(0.7), 2.0);
  EXPECT_EQ(e.Cdf(2.0), 0.75);
  EXPECT_EQ(Distribution::Empirical({4.0}).Quantile(0.2), 4.0);
  const Distribution cut = e.Truncated(2.0, 2.5);  // the tie and half of the last piece
  EXPECT_NEAR(cut.Quantile(0.79), 2.0, 1e-12);
  EXPECT_NEAR(cut.Quantile(0.9), 2.25, 1e-12);
}

TEST(Distribution, RefusesWhatIsNone) {
  const double nan = std::nan("");
  EXPECT_THROW(Distribution::Normal(0.0, 0.0), Error);
  EXPECT_THROW(Distribution::Normal(nan, 1.0), Error);
  EXPECT_THROW(Distribution::Uniform(1.0, 1.0), Error);
  EXPECT_THROW(Distribution::Uniform(-1e308, 1e308), Error);  // its width is no number
  EXPECT_THROW(Distribution::LogNormal(1.0, 1.0), Error);
  EXPECT_THROW(Distribution::LogNormal(-1.0, 2.0), Error);
  EXPECT_THROW(Distribution::LogUniform(0.0, 1.0), Error);
  EXPECT_THROW(Distribution::Triangular(0.0, 2.0, 1.0), Error);
  EXPECT_THROW(Distribution::Table({}), Error);
  EXPECT_THROW(Distribution::Table({1.0}, {0.0}), Error);
  EXPECT_THROW(Distribution::Table({1.0}, {1.0, 2.0}), Error);
  EXPECT_THROW(Distribution::Table({1.0, 2.0}, {1.0, -1.0}), Error);
  EXPECT_THROW(Distribution::Empirical({}), Error);
  EXPECT_THROW(Distribution::Normal(0.0, 1.0).Truncated(1.0, 1.0), Error);
  EXPECT_THROW(Distribution::Normal(0.0, 1.0).Truncated(60.0, 61.0), Error);
  EXPECT_THROW(Distribution::Table({1.0}).Truncated(2.0, 3.0), Error);
  EXPECT_THROW(Distribution::Empirical({1.0, 2.0}).Truncated(3.0, 4.0), Error);
  EXPECT_THROW(Distribution::Normal(0.0, 1.0).Quantile(0.0), Error);
  EXPECT_THROW(Distribution::Normal(0.0, 1.0).Quantile(nan), Error);
  EXPECT_EQ(Distribution::Uniform(2.0, 3.0).Quantile(0.0), 2.0);
}

TEST(Distribution, SaysWhatItIs) {
  EXPECT_EQ(Distribution::Normal(3.0, 0.1).Words(), "normal, mean 3, sigma 0.1");
  EXPECT_EQ(Distribution::LogUniform(1e-3, 1.0).Truncated(0.01, 0.5).Words(),
            "log-uniform, 0.001 to 1, truncated to 0.01 .. 0.5");
  EXPECT_EQ(Distribution::Table({1.0, 2.0}).Words(), "table: 1 (0.5), 2 (0.5)");
}

}  // namespace
}  // namespace unfurl::campaign::distribution_test
