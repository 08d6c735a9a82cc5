#include "campaign/statistics/margin_surrogate.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/random.h"
#include "tests/campaign/margins.h"

namespace unfurl::campaign::margin_surrogate_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Runs {
  Eigen::MatrixXd points;
  std::vector<double> margins;
};

Runs Sample(const MarginCase& c, int n, double scale) {
  Rng rng(3);
  Runs runs;
  runs.points.resize(c.dimensions, n);
  for (int i = 0; i < n; ++i) {
    std::vector<double> z;
    for (int d = 0; d < c.dimensions; ++d) {
      z.push_back(scale * rng.Normal());
      runs.points(d, i) = z.back();
    }
    runs.margins.push_back(c.margin(z));
  }
  return runs;
}

// A polynomial margin is met exactly, whatever its degree; a series of two by two pieces.
TEST(MarginSurrogateTest, MeetsWhatIsAPolynomial) {
  Eigen::MatrixXd opposite(4, 2);
  opposite << 2, -2, 2, -2, 2, -2, 2, -2;
  for (const MarginCase& c : {Linear(4, 1e-3), Sphere(4, 1e-3), TwoSided(4, 1e-3)}) {
    const Runs runs = Sample(c, 400, 1.5);
    const auto surrogate = MarginSurrogate::Fit(runs.points, runs.margins, kInfinity, opposite);
    ASSERT_TRUE(surrogate);
    EXPECT_LT(surrogate->error(), 1e-8) << c.name;
    EXPECT_NEAR(surrogate->Margin(Eigen::Vector4d(1.0, 0.5, 2.0, 1.0)),
                c.margin({1.0, 0.5, 2.0, 1.0}), 1e-8);
  }
  const Runs few = Sample(Linear(4, 1e-3), 10, 1.0);
  EXPECT_FALSE(MarginSurrogate::Fit(few.points, few.margins, kInfinity, opposite));
}

// Draws of the proposal have the density that its ratio tells: their inverse ratios average to the
// share of the scores with h > 0, and weights of failures to the probability.
TEST(SurrogateProposalTest, WeightsGiveTheProbability) {
  const MarginCase c = Exponentials(6, 1e-3);
  const Runs runs = Sample(c, 2000, 1.5);
  auto surrogate =
      MarginSurrogate::Fit(runs.points, runs.margins, 2.0, Eigen::MatrixXd::Zero(6, 1));
  ASSERT_TRUE(surrogate);
  const auto proposal = SurrogateProposal::Make(*surrogate, 6, 4000, 20000, 1);
  ASSERT_TRUE(proposal);
  double p = 0.0, square = 0.0;
  for (Eigen::Index i = 0; i < 4000; ++i) {
    const Eigen::VectorXd z = proposal->draws().col(i);
    if (c.margin({z.begin(), z.end()}) >= 0.0) continue;
    const double weight = 1.0 / proposal->Ratio(z);
    p += weight / 4000;
    square += weight * weight / 4000;
  }
  const double error = std::sqrt((square - p * p) / 4000) / p;
  EXPECT_NEAR(p / c.probability, 1.0, 4.0 * std::hypot(error, proposal->variation()));
  EXPECT_LT(proposal->variation(), 0.1);
  EXPECT_LT(error, 0.1);
}

}  // namespace
}  // namespace unfurl::campaign::margin_surrogate_test
