#include "campaign/statistics/runs_needed.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/design.h"
#include "campaign/statistics/summary.h"
#include "tests/campaign/coverage.h"

namespace unfurl::campaign::runs_needed_test {
namespace {

// What is forecast from 400 runs is what it then takes: with the runs told the interval is as
// narrow as wanted, within what 400 runs know of the scatter.
TEST(RunsNeededTest, TellsWhatItThenTakes) {
  Rng rng(2);
  for (const Population& population : Populations()) {
    for (const AnswerKind kind : {AnswerKind::kMean, AnswerKind::kQuantile}) {
      Wanted wanted{.kind = kind, .p = 0.9};
      const std::vector<double> some = Draw(population, 400, rng);
      wanted.half_width = RunsNeeded(wanted, some).history.back().half_width / 3.0;
      const RunsEstimate forecast = RunsNeeded(wanted, some);
      EXPECT_FALSE(forecast.met);
      EXPECT_NEAR(forecast.runs, 3600.0, 1.0);
      const RunsEstimate later = RunsNeeded(wanted, Draw(population, 3600, rng));
      // The width of a quantile's interval of 400 runs scatters by a fifth.
      EXPECT_NEAR(later.history.back().half_width / wanted.half_width, 1.0, 0.5) << population.name;
      EXPECT_EQ(later.history.size(), 5u);
      EXPECT_NEAR(later.slope, -0.5, 0.2) << population.name;
    }
  }
}

TEST(RunsNeededTest, OfAProbabilityIsClopperAndPearsons) {
  std::vector<double> yes(1000);
  std::fill(yes.begin(), yes.begin() + 100, 1.0);
  const Wanted wanted{.kind = AnswerKind::kProbability, .half_width = 0.01};
  const RunsEstimate estimate = RunsNeeded(wanted, yes);
  EXPECT_FALSE(estimate.met);
  // The normal approximation's, and the 1 / n by which the exact interval is wider.
  EXPECT_NEAR(estimate.runs, 1.96 * 1.96 * 0.09 / 1e-4 + 1.0 / 0.01, 10.0);
  const auto n = static_cast<std::size_t>(estimate.runs);
  const auto [low, high] = BinomialInterval((n + 5) / 10, n);
  EXPECT_LE((high - low) / 2, 0.01);
  // None seen: the upper bound 1 - 0.025^(1/n) is twice the half width.
  const RunsEstimate none = RunsNeeded(wanted, std::vector<double>(10, 0.0));
  EXPECT_NEAR(none.runs, std::log(0.025) / std::log(1.0 - 0.02), 2.0);
}

TEST(RunsNeededTest, KnowsWhenItIsMetAndWhenNothingIsKnown) {
  Rng rng(3);
  const std::vector<double> x = Draw(Populations()[0], 100, rng);
  EXPECT_TRUE(RunsNeeded({.half_width = 10.0}, x).met);
  EXPECT_EQ(RunsNeeded({.half_width = 10.0}, x).runs, 100.0);
  // Of 100 runs no interval of the 0.999 quantile: as many as it has one at.
  const RunsEstimate rare =
      RunsNeeded({.kind = AnswerKind::kQuantile, .p = 0.999, .half_width = 1.0}, x);
  EXPECT_FALSE(rare.met);
  EXPECT_NEAR(rare.runs, std::log(0.025) / std::log(0.999), 400.0);
  EXPECT_EQ(RunsNeeded({.half_width = 1.0}, {}).runs, 2.0);
  EXPECT_THROW(RunsNeeded({.half_width = -1.0}, x), Error);
  EXPECT_THROW(RunsNeeded({.p = 1.0}, x), Error);
}

TEST(RunsNeededTest, SeesThatASobolDesignPays) {
  const Design design({.kind = DesignKind::kSobol, .runs = 8192, .dimensions = 2});
  std::vector<double> x;
  std::vector<int> block;
  for (std::uint64_t i = 0; i < design.size(); ++i) {
    double u[2];
    design.Point(i, u);
    x.push_back(std::exp(u[0] + u[1]));
    block.push_back(design.Block(i));
  }
  EXPECT_LT(RunsNeeded({}, x, block).slope, -1.0);  // -1.5 for a smooth function
}

}  // namespace
}  // namespace unfurl::campaign::runs_needed_test
