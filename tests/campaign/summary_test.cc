#include "campaign/statistics/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/design.h"
#include "tests/campaign/coverage.h"

namespace unfurl::campaign::summary_test {
namespace {

using testing::HasSubstr;

TEST(Summarise, EqualsTheDefinitionsOfAShortList) {
  const Summary s = Summarise(std::vector<double>{4.0, 1.0, std::nan(""), 3.0, 2.0});
  EXPECT_EQ(s.n, 4u);
  EXPECT_EQ(s.failed, 1u);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.sigma, std::sqrt(5.0 / 3.0));
  EXPECT_DOUBLE_EQ(s.mean_error, std::sqrt(5.0 / 12.0));
  EXPECT_EQ(s.minimum, 1.0);
  EXPECT_EQ(s.maximum, 4.0);
  EXPECT_EQ(s.median, 2.5);
  EXPECT_NEAR(s.skewness, 0.0, 1e-15);
  EXPECT_NEAR(s.excess_kurtosis, 2.5625 / (1.25 * 1.25) - 3.0, 1e-12);
  EXPECT_TRUE(s.quantiles.empty());  // four values enclose no quantile with 95%
  ASSERT_EQ(s.notes.size(), 1u);
  EXPECT_THAT(s.notes[0], HasSubstr("1 of 5 runs failed"));
  // Symmetric values: Student's own interval.
  EXPECT_NEAR(s.mean_interval.HalfWidth(), 3.182446 * s.mean_error, 1e-6);
}

TEST(Summarise, OfNothingAndOfEqualValues) {
  const Summary none = Summarise(std::vector<double>{std::nan("")});
  EXPECT_EQ(none.n, 0u);
  EXPECT_THAT(none.notes.back(), HasSubstr("no run has a value"));
  const Summary one = Summarise(std::vector<double>{2.0});
  EXPECT_EQ(one.mean_interval.high, std::numeric_limits<double>::infinity());
  const Summary same = Summarise(std::vector<double>(100, 3.0));
  EXPECT_EQ(same.mean_interval.low, 3.0);
  EXPECT_EQ(same.histogram.counts, (std::vector<std::size_t>{100}));
  EXPECT_FALSE(same.tolerance[0].normal);
  EXPECT_THAT(same.notes.back(), HasSubstr("all values are equal"));
}

TEST(Summarise, KnowsNoUnits) {
  Rng rng(6);
  const std::vector<double> x = Draw(Populations()[2], 200, rng);
  const Summary one = Summarise(x);
  for (const double unit : {1e-140, 1e140}) {
    std::vector<double> scaled;
    for (double v : x) scaled.push_back(unit * v);
    const Summary other = Summarise(scaled);
    EXPECT_NEAR(other.mean_interval.high / unit, one.mean_interval.high, 1e-12);
    EXPECT_NEAR(other.sigma_interval.high / unit, one.sigma_interval.high, 1e-12);
    EXPECT_NEAR(other.excess_kurtosis, one.excess_kurtosis, 1e-9);
    EXPECT_EQ(other.histogram.counts.size(), one.histogram.counts.size());
  }
}

TEST(Summarise, RefusesWhatIsNoValue) {
  const std::vector<double> infinite = {1.0, std::numeric_limits<double>::infinity()};
  EXPECT_THROW(Summarise(infinite), Error);
  EXPECT_THROW(Summarise(std::vector<double>{1.0, 2.0}, std::vector<int>{0}), Error);
  EXPECT_THROW(Summarise(std::vector<double>{1.0}, {}, 1.0), Error);
  EXPECT_THROW(Summarise(std::vector<double>{1.0}, {}, std::nan("")), Error);
}

TEST(Summarise, CountsEveryValueInItsHistogram) {
  Rng rng(1);
  const std::vector<double> x = Draw(Populations()[2], 5000, rng);
  const Summary s = Summarise(x);
  const auto& h = s.histogram;
  EXPECT_EQ(std::accumulate(h.counts.begin(), h.counts.end(), std::size_t{0}), 5000u);
  EXPECT_NEAR(h.low + h.width * static_cast<double>(h.counts.size()), s.maximum, 1e-9);
  EXPECT_GT(h.counts.size(), 20u);
}

class SummaryOf : public testing::TestWithParam<Population> {};
INSTANTIATE_TEST_SUITE_P(All, SummaryOf, testing::ValuesIn(Populations()),
                         [](const auto& the) { return the.param.name; });

// Of any distribution: intervals of quantiles hold their quantile, tolerance intervals their
// content, and the band the whole function, as often as they say or more.
TEST_P(SummaryOf, HoldsWhatItSays) {
  constexpr int kRepeats = 600, kRuns = 500;
  const Population& population = GetParam();
  Rng rng(21);
  std::vector<double> truth = Draw(population, 400000, rng);
  std::sort(truth.begin(), truth.end());
  const auto cdf = [&](double x) {
    return static_cast<double>(std::upper_bound(truth.begin(), truth.end(), x) - truth.begin()) /
           static_cast<double>(truth.size());
  };
  std::vector<int> quantile(11), held(4), normal(4);
  int band = 0, normal_said = 0;
  for (int k = 0; k < kRepeats; ++k) {
    std::vector<double> x = Draw(population, kRuns, rng);
    const Summary s = Summarise(x);
    ASSERT_EQ(s.quantiles.size(), 9u);  // all but 0.001 and 0.999
    for (std::size_t q = 0; q < s.quantiles.size(); ++q) {
      const Interval i = s.quantiles[q].interval;
      const double exact = truth[static_cast<std::size_t>(s.quantiles[q].p * 400000)];
      quantile[q] += i.low <= exact && exact <= i.high;
    }
    for (std::size_t t = 0; t < 3; ++t) {
      const ToleranceEstimate& tolerance = s.tolerance[t];
      held[t] +=
          cdf(tolerance.two_sided->high) - cdf(tolerance.two_sided->low) >= tolerance.content;
      if (!tolerance.normal) continue;
      normal[t] += cdf(tolerance.normal->high) - cdf(tolerance.normal->low) >= tolerance.content;
    }
    EXPECT_FALSE(s.tolerance[3].two_sided);  // 99.9% asks for 4742 runs
    normal_said += s.tolerance[0].normal.has_value();
    std::sort(x.begin(), x.end());
    double off = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double f = cdf(x[i]);
      off = std::max(
          {off, f - static_cast<double>(i) / kRuns, static_cast<double>(i + 1) / kRuns - f});
    }
    band += off <= s.distribution_band;
  }
  const double least = 0.95 - ShareError(0.95, kRepeats);
  for (std::size_t q = 0; q < 9; ++q) EXPECT_GT(1.0 * quantile[q] / kRepeats, least) << q;
  for (std::size_t t = 0; t < 3; ++t) EXPECT_GT(1.0 * held[t] / kRepeats, least) << t;
  EXPECT_GT(1.0 * band / kRepeats, least);
  if (population.name == "normal") {
    EXPECT_NEAR(1.0 * normal_said / kRepeats, 0.95, ShareError(0.95, kRepeats) + 0.01);
    for (std::size_t t = 0; t < 3; ++t) {
      EXPECT_NEAR(1.0 * normal[t] / normal_said, 0.95, ShareError(0.95, normal_said) + 0.01) << t;
    }
  } else {
    EXPECT_LT(normal_said, kRepeats / 100);
  }
}

// Replicates of a Latin and a Sobol design: the interval from blocks holds the mean as often as it
// says, while that of independent runs would always hold it, being far too wide.
TEST(Summarise, BlocksGiveTheErrorOfTheDesign) {
  constexpr int kRepeats = 400;
  for (const DesignKind kind : {DesignKind::kLatin, DesignKind::kSobol}) {
    int held = 0;
    double narrower = 0.0;
    for (int k = 0; k < kRepeats; ++k) {
      const Design design(
          {.kind = kind, .runs = 512, .seed = static_cast<std::uint64_t>(k), .dimensions = 2});
      std::vector<double> x;
      std::vector<int> block;
      for (std::uint64_t i = 0; i < design.size(); ++i) {
        double u[2];
        design.Point(i, u);
        x.push_back(std::exp(u[0] + u[1]));
        block.push_back(design.Block(i));
      }
      const Summary s = Summarise(x, block);
      EXPECT_EQ(s.blocks, 16);
      const double exact = (std::exp(1.0) - 1.0) * (std::exp(1.0) - 1.0);
      held += s.mean_interval.low <= exact && exact <= s.mean_interval.high;
      narrower += s.mean_interval.HalfWidth() / MeanInterval(x, 0.95).HalfWidth() / kRepeats;
    }
    EXPECT_NEAR(1.0 * held / kRepeats, 0.95, ShareError(0.95, kRepeats));
    EXPECT_LT(narrower, 0.5);
  }
}

// Clopper and Pearson's interval holds the probability at least as often as it says.
TEST(ProportionTest, HoldsItsProbability) {
  constexpr int kRepeats = 1500;
  Rng rng(8);
  for (const double p : {0.001, 0.02, 0.5}) {
    int held = 0;
    for (int k = 0; k < kRepeats; ++k) {
      std::vector<double> x(300);
      for (double& v : x) v = rng.Uniform() < p;
      const ProportionEstimate e = Proportion(x);
      held += e.interval.low <= p && p <= e.interval.high;
    }
    EXPECT_GT(1.0 * held / kRepeats, 0.95 - ShareError(0.95, kRepeats)) << p;
  }
}

TEST(ProportionTest, CountsFailedRunsApart) {
  const ProportionEstimate e = Proportion(std::vector<double>{1.0, 0.0, std::nan(""), -2.0});
  EXPECT_EQ(e.n, 3u);
  EXPECT_EQ(e.yes, 2u);
  EXPECT_EQ(e.failed, 1u);
  EXPECT_EQ(Proportion({}).interval.high, 1.0);
}

}  // namespace
}  // namespace unfurl::campaign::summary_test
