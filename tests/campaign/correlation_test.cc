#include "campaign/statistics/correlation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign::correlation_test {
namespace {

using testing::HasSubstr;

double PearsonOf(const std::vector<double>& x, const std::vector<double>& y) {
  double product = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) product += (x[i] - Mean(x)) * (y[i] - Mean(y));
  return product / (static_cast<double>(x.size()) - 1) / std::sqrt(Variance(x) * Variance(y));
}

std::string MessageOf(const Eigen::MatrixXd& r) {
  try {
    Correlation(r, {"mass", "length", "gap"});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Correlation, IsThatOfTheScoresAndSpearmansFollows) {
  Eigen::MatrixXd r = Eigen::MatrixXd::Identity(4, 4);
  r(0, 2) = r(2, 0) = 0.8;
  r(0, 3) = r(3, 0) = -0.5;
  r(2, 3) = r(3, 2) = -0.2;
  const Correlation correlation(r);
  const CounterRandom random(3, 1);
  constexpr int kN = 4000;
  std::vector<std::vector<double>> u(4, std::vector<double>(kN)), z(4, std::vector<double>(kN));
  for (int i = 0; i < kN; ++i) {
    std::vector<double> point(4);
    for (std::uint32_t d = 0; d < 4; ++d) point[d] = random.Uniform(i, d);
    const double free = point[1];
    correlation.Apply(point);
    EXPECT_EQ(point[1], free);  // not correlated: its bits stay
    for (std::size_t d = 0; d < 4; ++d) {
      u[d][i] = point[d];
      z[d][i] = NormalQuantile(point[d]);
    }
  }
  for (int a = 0; a < 4; ++a) {
    // Still uniform: mean and variance within four standard errors.
    EXPECT_NEAR(Mean(u[a]), 0.5, 4 / std::sqrt(12.0 * kN));
    EXPECT_NEAR(Variance(u[a]), 1.0 / 12, 4 * std::sqrt(1.0 / 180 / kN));
    for (int b = 0; b < a; ++b) {
      // Four standard errors of a correlation of this many, (1 - r^2) / sqrt(n).
      const double error = 4 * (1 - r(a, b) * r(a, b)) / std::sqrt(kN);
      EXPECT_NEAR(PearsonOf(z[a], z[b]), r(a, b), error);
      EXPECT_NEAR(PearsonOf(u[a], u[b]), SpearmanOfScores(r(a, b)), 1.1 * error);
    }
  }
}

TEST(Correlation, StaysInsideTheCube) {
  Eigen::MatrixXd r = Eigen::MatrixXd::Ones(3, 3) * 0.999;
  r.diagonal().setOnes();
  const Correlation correlation(r);
  for (const double end : {0x1p-53, 1.0 - 0x1p-53}) {
    std::vector<double> u(3, end);
    correlation.Apply(u);
    for (double v : u) {
      EXPECT_GT(v, 0.0);
      EXPECT_LT(v, 1.0);
    }
  }
}

TEST(Correlation, NamesWhatIsWrong) {
  Eigen::MatrixXd r = Eigen::MatrixXd::Identity(3, 3);
  r(0, 1) = r(1, 0) = 1.0;
  EXPECT_THAT(MessageOf(r), HasSubstr("mass and length"));
  r(0, 1) = 0.5;
  r(1, 0) = 0.4;
  EXPECT_THAT(MessageOf(r), HasSubstr("two correlations of mass and length"));
  r(0, 1) = r(1, 0) = 0.9;
  r(1, 2) = r(2, 1) = 0.9;
  r(0, 2) = r(2, 0) = -0.9;
  EXPECT_THAT(MessageOf(r), HasSubstr("mass, length, gap that no inputs can have together"));
  r(2, 2) = 2.0;
  EXPECT_THAT(MessageOf(r), HasSubstr("gap with itself"));
  EXPECT_THAT(MessageOf(Eigen::MatrixXd::Zero(2, 3)), HasSubstr("2 x 3"));
  EXPECT_EQ(MessageOf(Eigen::MatrixXd::Identity(3, 3)), "");
}

TEST(Correlation, NoneChangesNothing) {
  std::vector<double> u = {0.1, 0.7};
  Correlation().Apply(u);
  Correlation(Eigen::MatrixXd::Identity(2, 2)).Apply(u);
  EXPECT_EQ(u, (std::vector<double>{0.1, 0.7}));
}

}  // namespace
}  // namespace unfurl::campaign::correlation_test
