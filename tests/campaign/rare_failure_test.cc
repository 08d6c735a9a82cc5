#include "campaign/statistics/rare_failure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/campaign/margins.h"

namespace unfurl::campaign::rare_failure_test {
namespace {

using testing::HasSubstr;

RareFailureResult Estimate(const MarginCase& c, std::uint64_t seed, int runs = 5000) {
  RareFailure rare({.dimensions = c.dimensions, .runs = runs, .seed = seed});
  Drive(&rare, c.margin);
  return rare.result();
}

// Two seeds each here; hundreds in rare_failure_slow_test.
class RareCase : public testing::TestWithParam<MarginCase> {};
INSTANTIATE_TEST_SUITE_P(All, RareCase,
                         testing::Values(Linear(2, 1e-4), Linear(20, 1e-4), FourBranch(1.0),
                                         Sphere(8, 1e-4), TwoSided(10, 1e-4), Steps(4, 3.9),
                                         Linear(3, 0.2), Linear(3, 1e-6)),
                         [](const auto& the) {
                           return the.param.name + "_" + std::to_string(the.index);
                         });

TEST_P(RareCase, IsWithinAFactorOfAHalfMoreInFiveThousandRuns) {
  for (const std::uint64_t seed : {1, 2}) {
    const RareFailureResult r = Estimate(GetParam(), seed);
    EXPECT_LE(r.runs, 5000u);
    EXPECT_TRUE(r.usable) << (r.notes.empty() ? "" : r.notes[0]);
    EXPECT_EQ(r.method, RareMethod::kImportance);
    EXPECT_LT(std::abs(std::log(r.probability / GetParam().probability)), std::log(1.5));
    // Four of what it says.
    EXPECT_LT(std::abs(std::log(r.probability / GetParam().probability)), 4.0 * r.variation);
  }
}

TEST(RareFailureTest, IsAFunctionOfItsSeed) {
  const MarginCase c = Linear(4, 1e-3);
  const RareFailureResult a = Estimate(c, 7, 2000), b = Estimate(c, 7, 2000);
  EXPECT_EQ(a.probability, b.probability);
  EXPECT_NE(a.probability, Estimate(c, 8, 2000).probability);
}

TEST(RareFailureTest, WithoutAMarginItCountsAndSaysSo) {
  const auto binary = [](double beta) {
    return [beta](const std::vector<double>& z) { return z[0] > beta ? -1.0 : 1.0; };
  };
  const RareFailureResult r = Estimate({"binary", 2, 0.01, binary(2.326348)}, 1);
  EXPECT_EQ(r.method, RareMethod::kRandom);
  EXPECT_TRUE(r.usable);
  EXPECT_THAT(r.notes.at(0), HasSubstr("ties"));
  EXPECT_LT(r.interval.low, 0.01);
  EXPECT_GT(r.interval.high, 0.01);
  const RareFailureResult none = Estimate({"none", 2, 0.0, binary(9.0)}, 1);
  EXPECT_FALSE(none.usable);
  EXPECT_EQ(none.probability, 0.0);
  EXPECT_NEAR(none.interval.high, 1.0 - std::pow(0.025, 1.0 / 4500), 1e-6);
}

TEST(RareFailureTest, SaysWhatFailedRunsMayHide) {
  const MarginCase c = Linear(3, 1e-3);
  const RareFailureResult r = Estimate(
      {"failing", 3, 1e-3,
       [&](const std::vector<double>& z) { return z[1] > 2.0 ? std::nan("") : c.margin(z); }},
      1);
  EXPECT_FALSE(r.usable);
  EXPECT_GT(r.with_failed, 0.01);
  EXPECT_THAT(r.notes.at(0), HasSubstr("count as no failure"));
}

// Runs without a margin that have nothing to do with failures: importance sampling hardly sees
// them, and what they may hide is still all of their share.
TEST(RareFailureTest, FailedRunsFarFromFailuresCountToo) {
  const MarginCase c = Linear(4, 1e-4);
  const RareFailureResult r = Estimate({"failing", 4, 1e-4,
                                        [&](const std::vector<double>& z) {
                                          return std::abs(z[3]) < 0.02 ? std::nan("") : c.margin(z);
                                        }},
                                       1);
  EXPECT_EQ(r.method, RareMethod::kImportance);
  EXPECT_NEAR(r.with_failed, 0.016, 0.016);  // of 500 runs: 8 of them, and four standard deviations
  EXPECT_GT(r.with_failed, 1e-3);
  EXPECT_FALSE(r.usable);
}

TEST(RareFailureTest, WhatAlwaysFailsHasTheProbabilityOne) {
  for (const double slope : {0.0, 0.1}) {
    const RareFailureResult r = Estimate(
        {"always", 2, 1.0, [=](const std::vector<double>& z) { return -1.0 + slope * z[0]; }}, 1);
    EXPECT_NEAR(r.probability, 1.0, 0.01);
    EXPECT_LT(r.interval.low, 1.0 - 3.0 / 5000);  // no run of 5000 was seen not to fail
    EXPECT_TRUE(r.usable);
  }
}

TEST(RareFailureTest, OutOfReachIsAnUpperBound) {
  const RareFailureResult r = Estimate(
      {"never", 2, 0.0, [](const std::vector<double>& z) { return 100.0 - z[0]; }}, 1, 1000);
  EXPECT_FALSE(r.usable);
  EXPECT_LE(r.runs, 1000u);
  EXPECT_THAT(r.notes.at(0), HasSubstr("did not reach failures"));
}

TEST(RareFailureTest, RefusesBadInput) {
  EXPECT_THROW(RareFailure({.dimensions = 2, .runs = 999}), Error);
  EXPECT_THROW(RareFailure({.dimensions = 0}), Error);
  EXPECT_THROW(RareFailure({.dimensions = 1, .confidence = 1.0}), Error);
  RareFailure rare({.dimensions = 2});
  EXPECT_THROW(rare.Answer(std::vector<double>(3, 1.0)), Error);
}

}  // namespace
}  // namespace unfurl::campaign::rare_failure_test
