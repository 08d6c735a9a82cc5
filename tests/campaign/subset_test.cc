#include "campaign/statistics/subset.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"
#include "tests/campaign/coverage.h"
#include "tests/campaign/margins.h"

namespace unfurl::campaign::subset_test {
namespace {

class SubsetOf : public testing::TestWithParam<MarginCase> {};
INSTANTIATE_TEST_SUITE_P(All, SubsetOf,
                         testing::Values(Linear(2, 1e-4), Linear(30, 1e-4), TwoSided(5, 1e-3),
                                         Sphere(10, 1e-4), Corner(3, 1e-5), Linear(3, 0.3)),
                         [](const auto& the) {
                           return the.param.name + "_" + std::to_string(the.index);
                         });

// Over seeds: the mean is the probability, and the scatter is what each run says of itself. The
// variation told leaves out the correlation between levels, which is worth up to a fifth of it.
TEST_P(SubsetOf, IsUnbiasedAndKnowsItsScatter) {
  const MarginCase& c = GetParam();
  constexpr int kRepeats = 60;
  std::vector<double> ratio, told;
  int held = 0;
  for (std::uint64_t seed = 1; seed <= kRepeats; ++seed) {
    SubsetSimulation subset(c.dimensions, 1000, 0.1, seed);
    Drive(&subset, c.margin);
    const SubsetResult& r = subset.result();
    EXPECT_EQ(r.end, SubsetEnd::kReached);
    ratio.push_back(r.probability / c.probability);
    told.push_back(r.variation);
    held += r.interval.low <= c.probability && c.probability <= r.interval.high;
  }
  const double scatter = std::sqrt(Variance(ratio));
  EXPECT_NEAR(Mean(ratio), 1.0, 4.0 * scatter / std::sqrt(kRepeats));
  // A standard deviation of 60 repeats is known to 9%; two of them.
  EXPECT_GT(Mean(told), scatter * 0.64);
  EXPECT_LT(Mean(told), scatter * 1.45);
  EXPECT_GE(1.0 * held / kRepeats, 0.90 - ShareError(0.90, kRepeats));
}

TEST(SubsetSimulationTest, IsAFunctionOfItsSeed) {
  const MarginCase c = Linear(4, 1e-3);
  std::vector<double> p;
  for (const std::uint64_t seed : {7, 7, 8}) {
    SubsetSimulation subset(4, 500, 0.1, seed);
    Drive(&subset, c.margin);
    p.push_back(subset.result().probability);
  }
  EXPECT_EQ(p[0], p[1]);
  EXPECT_NE(p[0], p[2]);
}

// Points of a level are those of the distribution inside it: of the first score given a half space,
// mean phi(b) / Phi(-b), while the others stay standard normal.
TEST(SubsetSimulationTest, ChainsSampleTheirLevel) {
  const double beta = 3.0;
  SubsetSimulation subset(
      SubsetOptions{.dimensions = 2, .runs_per_level = 20000, .seed = 3, .sample_failures = true});
  Drive(&subset, [&](const std::vector<double>& z) { return beta - z[0]; });
  const Eigen::MatrixXd failures = subset.Failures();
  ASSERT_EQ(failures.cols(), 20000);
  const double mean = std::exp(-4.5) / std::sqrt(2.0 * std::numbers::pi) / NormalCdf(-beta);
  EXPECT_NEAR(failures.row(0).mean(), mean, 0.02);  // 0.28 / sqrt(20000 / 10), and four of them
  EXPECT_NEAR(failures.row(1).mean(), 0.0, 0.1);
  EXPECT_NEAR(failures.row(1).squaredNorm() / 20000, 1.0, 0.15);
  EXPECT_GT(failures.row(0).minCoeff(), beta);
}

TEST(SubsetSimulationTest, FailedRunsAreNoFailuresButAreCounted) {
  const MarginCase c = Linear(3, 1e-3);
  SubsetSimulation subset(3, 2000, 0.1, 5);
  Drive(&subset, [&](const std::vector<double>& z) {
    return z[1] > 2.0 ? std::nan("") : c.margin(z);  // 2.3% of all runs
  });
  const SubsetResult& r = subset.result();
  EXPECT_EQ(r.end, SubsetEnd::kReached);
  EXPECT_GT(r.failed, 20u);
  EXPECT_LT(r.probability, c.probability);
  EXPECT_GT(r.with_failed, 0.0228 * 0.6);
}

TEST(SubsetSimulationTest, SaysWhenMarginsDoNotLead) {
  SubsetSimulation binary(2, 500, 0.1, 1);
  Drive(&binary, [](const std::vector<double>& z) { return z[0] > 3.0 ? -1.0 : 1.0; });
  EXPECT_EQ(binary.result().end, SubsetEnd::kStalled);
  SubsetSimulation never(SubsetOptions{.dimensions = 2, .runs_per_level = 200, .most_levels = 4});
  Drive(&never, [](const std::vector<double>& z) { return 100.0 - z[0]; });
  EXPECT_EQ(never.result().end, SubsetEnd::kOutOfRuns);
  EXPECT_LT(never.result().probability, 2e-4);
  SubsetSimulation failed(2, 500, 0.1, 1);
  Drive(&failed, [](const std::vector<double>&) { return std::nan(""); });
  EXPECT_EQ(failed.result().end, SubsetEnd::kStalled);
  EXPECT_EQ(failed.result().failed, 500u);
  EXPECT_EQ(failed.result().with_failed, 1.0);
}

TEST(SubsetSimulationTest, RefusesBadInput) {
  EXPECT_THROW(SubsetSimulation(0, 500, 0.1, 1), Error);
  EXPECT_THROW(SubsetSimulation(2, 50, 0.1, 1), Error);
  EXPECT_THROW(SubsetSimulation(2, 500, 0.9, 1), Error);
  SubsetSimulation subset(2, 500, 0.1, 1);
  EXPECT_THROW(subset.Answer(std::vector<double>(499, 1.0)), Error);
  EXPECT_THROW(subset.Answer(std::vector<double>(500, std::numeric_limits<double>::infinity())),
               Error);
}

}  // namespace
}  // namespace unfurl::campaign::subset_test
