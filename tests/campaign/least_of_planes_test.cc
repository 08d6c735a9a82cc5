#include "campaign/statistics/least_of_planes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"

namespace unfurl::campaign::least_of_planes_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::MatrixXd Normal(int d, int n, Rng& rng) {
  Eigen::MatrixXd points(d, n);
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = 1.5 * rng.Normal();
  return points;
}

// Planes that made the values are found again, however many, with slopes of any direction.
TEST(LeastOfPlanesTest, FindsThePlanesThatMadeTheValues) {
  Rng rng(5);
  for (const int planes : {1, 2, 4, 7}) {
    Eigen::MatrixXd truth = Normal(11, planes, rng);
    const Eigen::MatrixXd points = Normal(10, 3000, rng);
    Eigen::VectorXd y(3000);
    for (Eigen::Index i = 0; i < 3000; ++i) {
      y[i] =
          (truth.row(0).transpose() + truth.bottomRows(10).transpose() * points.col(i)).minCoeff();
    }
    const LeastOfPlanes fit = FitLeastOfPlanes(points, y, kInfinity, 2);
    EXPECT_LT(fit.error, 1e-9) << planes;
    EXPECT_GE(fit.coefficients.cols(), planes);
    const Eigen::VectorXd z = Normal(10, 1, rng);
    EXPECT_NEAR(fit.At(z),
                (truth.row(0).transpose() + truth.bottomRows(10).transpose() * z).minCoeff(), 1e-8);
  }
}

// Leave-one-out tells the error of points that were not there.
TEST(LeastOfPlanesTest, KnowsItsErrorUnderNoise) {
  Rng rng(6);
  const auto sample = [&](int n) {
    std::pair<Eigen::MatrixXd, Eigen::VectorXd> s{Normal(8, n, rng), Eigen::VectorXd(n)};
    for (int i = 0; i < n; ++i)
      s.second[i] = 3.0 - s.first.col(i).cwiseAbs().maxCoeff() + 0.2 * rng.Normal();
    return s;
  };
  const auto [points, y] = sample(1500);
  const LeastOfPlanes fit = FitLeastOfPlanes(points, y, kInfinity, 2);
  const auto [fresh, truth] = sample(4000);
  double square = 0.0;
  for (Eigen::Index i = 0; i < 4000; ++i)
    square += std::pow(fit.At(fresh.col(i)) - truth[i], 2.0) / 4000;
  EXPECT_NEAR(std::sqrt(square) / fit.error, 1.0, 0.2);
}

TEST(LeastOfPlanesTest, OfTooFewPointsIsNone) {
  Rng rng(7);
  const LeastOfPlanes fit =
      FitLeastOfPlanes(Normal(10, 20, rng), Eigen::VectorXd::Ones(20), kInfinity, 2);
  EXPECT_EQ(fit.error, kInfinity);
}

}  // namespace
}  // namespace unfurl::campaign::least_of_planes_test
