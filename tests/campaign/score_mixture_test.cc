#include "campaign/statistics/score_mixture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace unfurl::campaign::score_mixture_test {
namespace {

// n points about each of the centres (columns), normal with the standard deviation `sigma`.
Eigen::MatrixXd About(const Eigen::MatrixXd& centres, int n, double sigma, Rng& rng) {
  Eigen::MatrixXd points(centres.rows(), n * centres.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    for (Eigen::Index d = 0; d < points.rows(); ++d) {
      points(d, i) = centres(d, i % centres.cols()) + sigma * rng.Normal();
    }
  }
  return points;
}

// The weights are a density's: over the mixture's own draws the mean weight is 1, whatever is
// drawn, and a weighted mean is that of the scores.
TEST(ScoreMixtureTest, WeightsBelongToItsDraws) {
  Rng rng(1);
  Eigen::MatrixXd centres = Eigen::MatrixXd::Zero(3, 2);
  centres(0, 0) = 1.5;
  centres(0, 1) = -1.5;
  Eigen::MatrixXd points = About(centres, 400, 1.0, rng);
  points.row(2) *= 2.0;  // wider along one axis
  const ScoreMixture mixture(points, Eigen::VectorXd::Ones(points.cols()), 800.0, 0.2, 1);
  const CounterRandom random(1, 99);
  double sum = 0.0, first = 0.0, square = 0.0;
  constexpr int kN = 40000;
  for (std::uint64_t i = 0; i < kN; ++i) {
    const Eigen::VectorXd z = mixture.Draw(random, i);
    const double w = std::exp(mixture.LogWeight(z));
    EXPECT_LT(w, 100.0);
    sum += w / kN;
    first += w * z[0] / kN;
    square += w * z[2] * z[2] / kN;
  }
  EXPECT_NEAR(sum, 1.0, 0.03);
  EXPECT_NEAR(first, 0.0, 0.05);
  EXPECT_NEAR(square, 1.0, 0.06);
}

TEST(ScoreMixtureTest, FindsRegionsAndWidensWhereThePointsAre) {
  Rng rng(2);
  Eigen::MatrixXd centres = Eigen::MatrixXd::Zero(20, 2);
  centres(3, 0) = 4.0;
  centres(3, 1) = -4.0;
  const Eigen::MatrixXd two = About(centres, 200, 0.9, rng);
  const ScoreMixture mixture(two, Eigen::VectorXd::Ones(400), 400.0, 0.0, 1);
  ASSERT_EQ(mixture.components().size(), 2u);
  EXPECT_NEAR(std::abs(mixture.components()[0].mean[3]), 4.0, 0.3);
  EXPECT_EQ(mixture.components()[0].variance, 1.0);  // never narrower than the scores
  Eigen::MatrixXd wide = About(Eigen::MatrixXd::Zero(20, 1), 400, 1.0, rng);
  wide.row(5) *= 1.7;
  const ScoreMixture one(wide, Eigen::VectorXd::Ones(400), 100.0, 0.0, 1);  // of few chains
  ASSERT_EQ(one.components().size(), 1u);
  ASSERT_EQ(one.components()[0].variances.size(), 1);
  EXPECT_NEAR(one.components()[0].variances[0], 2.89, 0.7);
  EXPECT_NEAR(std::abs(one.components()[0].axes(5, 0)), 1.0, 0.15);
}

}  // namespace
}  // namespace unfurl::campaign::score_mixture_test
