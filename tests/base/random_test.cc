#include "base/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random_vector.h"
#include "base/statistics.h"

namespace unfurl::random_test {
namespace {

constexpr int kDraws = 200000;
// Means of kDraws draws scatter by sigma / sqrt(kDraws); five of those is one failure in a million.
const double kFiveSigma = 5.0 / std::sqrt(kDraws);

TEST(Rng, TheSameSeedGivesTheSameDraws) {
  Rng a(7), b(7), c(8);
  for (int i = 0; i < 100; ++i) {
    const double x = a.Normal();
    EXPECT_EQ(x, b.Normal());
    EXPECT_NE(x, c.Normal());
  }
}

TEST(Rng, StreamsDoNotDependOnWhatWasDrawnBefore) {
  Rng a(7), b(7);
  a.Normal();
  EXPECT_EQ(a.Stream("noise", 3).Uniform(), b.Stream("noise", 3).Uniform());
  EXPECT_NE(a.Stream("noise", 3).Uniform(), b.Stream("noise", 4).Uniform());
  EXPECT_NE(a.Stream("noise", 3).Uniform(), b.Stream("pose", 3).Uniform());
}

// By which the shipped recordings were made, whatever compiler made this.
TEST(Rng, VectorsAreDrawnFromTheLast) {
  Rng a(7), b(7);
  const Eigen::Vector3d normal = NormalVector(&a), uniform = UniformVector(&a, -2.0, 3.0);
  for (const Eigen::Index k : {2, 1, 0}) EXPECT_EQ(normal(k), b.Normal());
  for (const Eigen::Index k : {2, 1, 0}) EXPECT_EQ(uniform(k), b.Uniform(-2.0, 3.0));
}

TEST(Rng, NormalHasItsFirstFourMoments) {
  Rng rng(1);
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.Normal();
    m1 += x, m2 += x * x, m3 += x * x * x, m4 += x * x * x * x;
  }
  EXPECT_NEAR(m1 / kDraws, 0.0, kFiveSigma);
  EXPECT_NEAR(m2 / kDraws, 1.0, kFiveSigma * std::sqrt(2.0));
  EXPECT_NEAR(m3 / kDraws, 0.0, kFiveSigma * std::sqrt(15.0));
  EXPECT_NEAR(m4 / kDraws, 3.0, kFiveSigma * std::sqrt(96.0));
}

TEST(Rng, PoissonHasMeanAndVarianceAlikeOnBothSidesOfItsSwitch) {
  for (double mean : {0.3, 5.0, 29.0, 31.0, 4000.0}) {
    Rng rng(3);
    std::vector<double> x(kDraws);
    for (double& v : x) v = rng.Poisson(mean);
    EXPECT_NEAR(Mean(x), mean, kFiveSigma * std::sqrt(mean)) << mean;
    // Rounding to whole counts adds 1/12; the variance of a sample variance is about
    // (2 mean^2 + mean) / n.
    const double slack =
        kFiveSigma * std::sqrt(2 * mean * mean + mean) + (mean > 30 ? 1.0 / 12 : 0);
    EXPECT_NEAR(Variance(x), mean, slack) << mean;
  }
}

TEST(Rng, IntegerReachesAllAndOnlyItsRange) {
  Rng rng(5);
  std::vector<int> seen(7, 0);
  for (int i = 0; i < 7000; ++i) ++seen.at(rng.Integer(7));
  for (int count : seen) EXPECT_NEAR(count, 1000, 5 * std::sqrt(1000.0));
}

}  // namespace
}  // namespace unfurl::random_test
