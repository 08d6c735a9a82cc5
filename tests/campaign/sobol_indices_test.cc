#include "campaign/statistics/sobol_indices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/campaign/coverage.h"
#include "tests/campaign/functions.h"

namespace unfurl::campaign::sobol_indices_test {
namespace {

using testing::HasSubstr;

class OfFunction : public testing::TestWithParam<TestFunction> {};
INSTANTIATE_TEST_SUITE_P(All, OfFunction, testing::Values(Ishigami(), GFunction()),
                         [](const auto& the) { return the.param.name; });

TEST_P(OfFunction, EqualsItsClosedForm) {
  const TestFunction& f = GetParam();
  const Design design({.kind = DesignKind::kSaltelli,
                       .runs = 8192 * static_cast<std::uint64_t>(f.dimensions + 2),
                       .dimensions = f.dimensions});
  const SobolIndices s = IndicesOfSaltelli(RunAll(design, f.f), f.dimensions);
  EXPECT_TRUE(s.usable);
  EXPECT_EQ(s.rows, 8192u);
  EXPECT_NEAR(s.variance, f.variance, 0.02 * f.variance);
  for (std::size_t k = 0; k < s.inputs.size(); ++k) {
    const SobolIndex& i = s.inputs[k];
    // Four of the errors told, which for 8192 rows are below 0.02.
    EXPECT_NEAR(i.first, f.first[k], 4 * i.first_error + 1e-6) << k;
    EXPECT_NEAR(i.total, f.total[k], 4 * i.total_error + 1e-6) << k;
    EXPECT_LT(i.first_error, 0.02);
    EXPECT_LT(i.total_error, 0.02);
  }
}

// Over seeds the intervals hold the truth as often as they say, or more: rows of a scrambled Sobol
// sequence are better than independent ones.
TEST_P(OfFunction, IntervalsHold) {
  const TestFunction& f = GetParam();
  constexpr int kRepeats = 60;
  int held = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= kRepeats; ++seed) {
    const Design design({.kind = DesignKind::kSaltelli,
                         .runs = 256 * static_cast<std::uint64_t>(f.dimensions + 2),
                         .seed = seed,
                         .dimensions = f.dimensions});
    const SobolIndices s = IndicesOfSaltelli(RunAll(design, f.f), f.dimensions, 0.95, seed);
    EXPECT_TRUE(s.usable);
    for (std::size_t k = 0; k < s.inputs.size(); ++k) {
      const SobolIndex& i = s.inputs[k];
      held += i.first_interval.low <= f.first[k] && f.first[k] <= i.first_interval.high;
      held += i.total_interval.low <= f.total[k] && f.total[k] <= i.total_interval.high;
      all += 2;
    }
  }
  EXPECT_GT(1.0 * held / all, 0.95 - ShareError(0.95, kRepeats)) << "of " << all;
}

TEST(IndicesOfSaltelliTest, KnowNoUnits) {
  const Design design({.kind = DesignKind::kSaltelli, .runs = 1000, .dimensions = 3});
  std::vector<double> values = RunAll(design, Ishigami().f);
  const SobolIndices one = IndicesOfSaltelli(values, 3);
  for (double& v : values) v = 1e150 * (v + 1000.0);
  const SobolIndices other = IndicesOfSaltelli(values, 3);
  EXPECT_TRUE(other.usable);
  EXPECT_NEAR(other.inputs[0].total, one.inputs[0].total, 1e-9);
  EXPECT_NEAR(other.inputs[1].first_error, one.inputs[1].first_error, 1e-9);
  EXPECT_NEAR(other.variance / 1e300, one.variance, 1e-9);
}

TEST(IndicesOfSaltelliTest, FailedRunsDropTheirRows) {
  const TestFunction f = Ishigami();
  const Design design({.kind = DesignKind::kSaltelli, .runs = 5000, .dimensions = 3});
  std::vector<double> values = RunAll(design, f.f);
  values[7] = values[8] = values[303] = std::nan("");
  const SobolIndices s = IndicesOfSaltelli(values, 3);
  EXPECT_EQ(s.dropped, 2u);
  EXPECT_EQ(s.rows, 998u);
  EXPECT_THAT(s.notes.at(0), HasSubstr("2 of 1000 rows"));
  EXPECT_TRUE(s.usable);
}

TEST(IndicesOfSaltelliTest, SaysWhenItCannotBeUsed) {
  EXPECT_FALSE(IndicesOfSaltelli(std::vector<double>(95, 1.0), 3).usable);  // 19 rows
  const SobolIndices flat = IndicesOfSaltelli(std::vector<double>(5000, 1.0), 3);
  EXPECT_FALSE(flat.usable);
  EXPECT_THAT(flat.notes.at(0), HasSubstr("does not vary"));
  // Every column moves all, as where inputs are the same one: shares that add up to three.
  const Design design({.kind = DesignKind::kSaltelli, .runs = 5000, .dimensions = 3});
  std::vector<double> values = RunAll(design, Ishigami().f);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = values[i / 5 * 5 + (i % 5 > 0)];
  const SobolIndices same = IndicesOfSaltelli(values, 3);
  EXPECT_FALSE(same.usable);
  EXPECT_THAT(same.notes.at(0), HasSubstr("add up to 3"));
  EXPECT_THROW(IndicesOfSaltelli({}, 0), Error);
}

}  // namespace
}  // namespace unfurl::campaign::sobol_indices_test
