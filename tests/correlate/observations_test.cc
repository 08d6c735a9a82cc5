// What is compared with a model: sizes, stamps, clocks and cuts against their definitions.
#include "correlate/observations.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "correlate/sampled_model.h"

namespace unfurl::correlate::observations_test {
namespace {

constexpr int kRank = 2;

// Every number of a sample tells which mark and sample it is of.
MarkSeries Counted(double mark, const std::vector<double>& stamps) {
  MarkSeries series;
  series.name = "m" + std::to_string(static_cast<int>(mark));
  series.t = stamps;
  const auto n = static_cast<Eigen::Index>(stamps.size());
  series.p.resize(3, n);
  series.cov.resize(6, n);
  series.shared.resize(3, n * kRank);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double value = mark + 0.01 * static_cast<double>(i);
    series.p.col(i) = Eigen::Vector3d(value, 2.0 * value, 3.0 * value);
    series.cov.col(i) << 4.0 + value, 0.1, 0.2, 5.0 + value, 0.3, 6.0 + value;
    for (Eigen::Index k = 0; k < kRank; ++k) {
      series.shared.col(i * kRank + k).setConstant(value + 100.0 * static_cast<double>(k));
    }
  }
  return series;
}

// The mark that begins first ends first, one has no samples, and gaps are uneven.
Observations Uneven() {
  Observations o;
  o.shared_rank = kRank;
  o.marks = {Counted(1.0, {-0.3, 0.1, 0.2, 0.9}), Counted(2.0, {}), Counted(3.0, {0.5, 1.7, 2.0})};
  return o;
}

TEST(Observations, SixNumbersAreASymmetricMatrix) {
  Eigen::Matrix<double, 6, 1> c;
  c << 11.0, 12.0, 13.0, 22.0, 23.0, 33.0;  // row and column of each
  const Eigen::Matrix3d m = Symmetric(c);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_EQ(m(i, j), 10.0 * (std::min(i, j) + 1) + std::max(i, j) + 1);
    }
  }
}

TEST(Observations, ReachFromTheFirstStampOfAllToTheLast) {
  Observations o = Uneven();
  EXPECT_EQ(o.size(), 7U);
  EXPECT_EQ(o.Start(), -0.3);
  EXPECT_EQ(o.End(), 2.0);
  EXPECT_EQ(o.Pivot(), 0.85);
  o.placement.pivot = 0.4;
  EXPECT_EQ(o.Pivot(), 0.4);
  EXPECT_EQ(o.FindMark("m3"), 2);
  EXPECT_EQ(o.FindMark("m4"), -1);
}

TEST(Observations, ACutKeepsWhatBelongsToItsSamples) {
  const Observations all = Uneven();
  const Observations part = Cut(all, {0.15, 1.8});
  ASSERT_EQ(part.marks.size(), 3U);
  EXPECT_EQ(part.marks[0].t, (std::vector<double>{0.2, 0.9}));
  EXPECT_EQ(part.marks[2].t, (std::vector<double>{0.5, 1.7}));
  EXPECT_EQ(part.marks[0].p, all.marks[0].p.rightCols(2));
  EXPECT_EQ(part.marks[0].cov, all.marks[0].cov.rightCols(2));
  EXPECT_EQ(part.marks[0].shared, all.marks[0].shared.rightCols(2 * kRank));
  EXPECT_EQ(part.marks[2].shared, all.marks[2].shared.leftCols(2 * kRank));
  EXPECT_EQ(part.Pivot(), all.Pivot());  // of the whole
}

// A clock's rate taken out of the stamps is the same clock without a rate.
TEST(Observations, WithoutItsDriftARecordHasTheSameModelTimes) {
  constexpr double kOffset = 0.25, kDrift = 2e-3;
  Observations o = Uneven();
  o.placement.drift = Prior::Normal(3e-3, 1e-3);
  const Observations straight = WithoutDrift(o, kDrift, o.Pivot());
  const Stamps a = o.StampsAt({kOffset, kDrift}), b = straight.StampsAt({kOffset, 0.0});
  for (std::size_t m = 0; m < a.t.size(); ++m) {
    ASSERT_EQ(a.t[m].size(), b.t[m].size());
    for (std::size_t i = 0; i < a.t[m].size(); ++i) EXPECT_NEAR(a.t[m][i], b.t[m][i], 1e-15);
  }
  // Two rates, one after the other, multiply.
  EXPECT_NEAR((1.0 + straight.placement.drift.mean) * (1.0 + kDrift), 1.0 + 3e-3, 1e-15);
}

TEST(MedianStep, IsTheMiddleOfTheSteps) {
  EXPECT_EQ(MedianStep(std::vector<double>{0.0, 1.0, 3.0, 7.0, 15.0, 31.0}), 4.0);
  EXPECT_EQ(MedianStep(std::vector<double>{0.5, 0.75}), 0.25);
  EXPECT_EQ(MedianStep(std::vector<double>{0.5}), 0.0);
}

}  // namespace
}  // namespace unfurl::correlate::observations_test
