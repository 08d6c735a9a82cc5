#include "campaign/statistics/design.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::campaign::design_test {
namespace {

std::vector<double> PointOf(const Design& design, std::uint64_t index) {
  std::vector<double> u(static_cast<std::size_t>(design.spec().dimensions));
  design.Point(index, u);
  for (double v : u) {
    EXPECT_GT(v, 0.0);
    EXPECT_LT(v, 1.0);
  }
  return u;
}

TEST(Design, RandomAndSobolGrowWithoutChanging) {
  for (const DesignKind kind :
       {DesignKind::kRandom, DesignKind::kSobol, DesignKind::kSaltelli, DesignKind::kMorris}) {
    const Design small({.kind = kind, .runs = 120, .dimensions = 3});
    const Design large({.kind = kind, .runs = 1'000'000'000'000, .dimensions = 3});
    for (std::uint64_t i = 0; i < 120; ++i) EXPECT_EQ(PointOf(small, i), PointOf(large, i));
    PointOf(large, large.size() - 1);
  }
}

TEST(Design, SeedsAndDimensionsGiveOtherPoints) {
  for (const DesignKind kind :
       {DesignKind::kRandom, DesignKind::kLatin, DesignKind::kSobol, DesignKind::kSaltelli}) {
    std::set<double> seen;
    for (const std::uint64_t seed : {0, 1, 2}) {
      const Design design({.kind = kind, .runs = 5, .seed = seed, .dimensions = 3});
      for (double v : PointOf(design, 0)) seen.insert(v);
    }
    EXPECT_EQ(seen.size(), 9u);
  }
}

// One point in each stratum of every block and dimension, also where blocks differ in size.
TEST(Design, LatinIsStratifiedInEachBlock) {
  for (const std::uint64_t runs : {1, 2, 7, 160, 997}) {
    const Design design({.kind = DesignKind::kLatin, .runs = runs, .dimensions = 4, .blocks = 16});
    const auto blocks = static_cast<std::uint64_t>(design.blocks());
    for (std::uint64_t block = 0; block < blocks; ++block) {
      const std::uint64_t strata = runs / blocks + (block < runs % blocks ? 1 : 0);
      std::vector<std::set<int>> seen(4);
      for (std::uint64_t i = block; i < runs; i += blocks) {
        EXPECT_EQ(design.Block(i), static_cast<int>(block));
        const std::vector<double> u = PointOf(design, i);
        for (int d = 0; d < 4; ++d) {
          seen[d].insert(static_cast<int>(u[d] * static_cast<double>(strata)));
        }
      }
      for (const auto& cells : seen) EXPECT_EQ(cells.size(), strata) << runs;
    }
  }
}

// Variances of a mean over seeds: Latin strata leave what is not a sum of functions of one input
// [Stein 1987]; for a sum, next to nothing.
TEST(Design, LatinAndSobolMeansScatterLess) {
  const auto scatter = [](DesignKind kind) {
    std::vector<double> means;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
      const Design design({.kind = kind, .runs = 256, .seed = seed, .dimensions = 3, .blocks = 4});
      double sum = 0.0;
      for (std::uint64_t i = 0; i < design.size(); ++i) {
        const std::vector<double> u = PointOf(design, i);
        sum += u[0] + u[1] * u[1] + std::exp(u[2]);
      }
      means.push_back(sum / 256);
    }
    return std::sqrt(Variance(means));
  };
  const double random = scatter(DesignKind::kRandom);
  // sqrt((1/12 + 4/45 + 0.2420) / 256): the variances of u, u^2 and exp(u).
  EXPECT_NEAR(random, std::sqrt(0.41422 / 256), 0.3 * std::sqrt(0.41422 / 256));
  EXPECT_LT(scatter(DesignKind::kLatin), 0.1 * random);
  EXPECT_LT(scatter(DesignKind::kSobol), 0.1 * random);
}

TEST(Design, AGridHasEveryCombinationOnce) {
  const Design design({.kind = DesignKind::kGrid, .dimensions = 3, .levels = {2, 3, 5}});
  ASSERT_EQ(design.size(), 30u);
  std::set<std::vector<double>> points;
  for (std::uint64_t i = 0; i < 30; ++i) points.insert(PointOf(design, i));
  EXPECT_EQ(points.size(), 30u);
  EXPECT_EQ(PointOf(design, 1), (std::vector<double>{0.25, 0.5 / 3, 0.3}));
  EXPECT_EQ(PointOf(design, 29), (std::vector<double>{0.75, 2.5 / 3, 0.9}));
  EXPECT_EQ(Design({.kind = DesignKind::kGrid, .dimensions = 3, .levels = {4}}).size(), 64u);
}

TEST(Design, SaltelliRowsExchangeOneColumn) {
  const Design design({.kind = DesignKind::kSaltelli, .runs = 103, .dimensions = 3});
  EXPECT_EQ(design.row(), 5u);
  ASSERT_EQ(design.size(), 100u);  // whole rows
  for (std::uint64_t row = 0; row < 20; ++row) {
    const std::vector<double> a = PointOf(design, 5 * row), b = PointOf(design, 5 * row + 1);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NE(a[k], b[k]);
      std::vector<double> expected = a;
      expected[k] = b[k];
      EXPECT_EQ(PointOf(design, 5 * row + 2 + k), expected);
    }
  }
  // More inputs than there are direction numbers for twice of them: random rows.
  const Design wide({.kind = DesignKind::kSaltelli, .runs = 2003, .dimensions = 2000});
  EXPECT_EQ(PointOf(wide, 1)[7], PointOf(wide, 2 + 7)[7]);
}

TEST(Design, MorrisTrajectoriesChangeOneInputAStep) {
  const DesignSpec spec{
      .kind = DesignKind::kMorris, .runs = 6 * 500, .dimensions = 5, .morris_levels = 4};
  const Design design(spec);
  std::vector<int> first(5), up(5);
  std::vector<double> level(4);
  for (std::uint64_t t = 0; t < 500; ++t) {
    const std::vector<int> steps = MorrisSteps(spec, t);
    for (double v : PointOf(design, 6 * t)) ++level[static_cast<std::size_t>(4 * v)];
    for (int step = 1; step <= 5; ++step) {
      const auto before = PointOf(design, 6 * t + step - 1), after = PointOf(design, 6 * t + step);
      for (int d = 0; d < 5; ++d) {
        EXPECT_EQ(std::abs(after[d] - before[d]), steps[d] == step ? 0.5 : 0.0);
        if (steps[d] == step && after[d] > before[d]) ++up[d];
        if (steps[d] == step && step == 1) ++first[d];
      }
    }
  }
  double chi_square = 0.0;
  for (double n : level) chi_square += (n - 625) * (n - 625) / 625;
  EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, 3));
  for (int d = 0; d < 5; ++d) {  // within four standard deviations of 1/2 and 1/5 of 500
    EXPECT_NEAR(up[d], 250, 4 * std::sqrt(125.0));
    EXPECT_NEAR(first[d], 100, 4 * std::sqrt(80.0));
  }
}

TEST(Design, RefusesWhatMakesNone) {
  const auto refused = [](const DesignSpec& spec) { EXPECT_THROW(Design{spec}, Error); };
  refused({.runs = 0});
  refused({.runs = 1, .dimensions = 0});
  refused({.runs = (1ULL << 63) + 1});
  refused({.kind = DesignKind::kSobol, .runs = 1, .dimensions = 4000});
  refused({.kind = DesignKind::kSobol, .runs = 1, .blocks = 1});
  refused({.kind = DesignKind::kGrid, .dimensions = 2});
  refused({.kind = DesignKind::kGrid, .dimensions = 2, .levels = {2, 0}});
  refused({.kind = DesignKind::kGrid, .dimensions = 64, .levels = {2, 2, 2}});
  refused({.kind = DesignKind::kGrid, .dimensions = 65, .levels = {2}});  // 2^65 points
  refused({.kind = DesignKind::kSaltelli, .runs = 4, .dimensions = 3});
  refused({.kind = DesignKind::kMorris, .runs = 3, .dimensions = 3});
  refused({.kind = DesignKind::kMorris, .runs = 30, .dimensions = 3, .morris_levels = 3});
  std::vector<double> u(2);
  EXPECT_THROW(Design({.runs = 3, .dimensions = 2}).Point(3, u), Error);
  EXPECT_THROW(Design({.runs = 3, .dimensions = 3}).Point(0, u), Error);
}

}  // namespace
}  // namespace unfurl::campaign::design_test
