// Profiles of the cost along each parameter.
#include "correlate/fit/profile.h"

#include <gtest/gtest.h>

#include <cmath>

#include "correlate/fit/fit.h"
#include "tests/correlate/alike_parts.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate::profile_test {
namespace {

FitResult WithLevels(const Observations& data, const Model& model,
                     const std::vector<double>& levels) {
  FitProblem problem;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  problem.parameters = TwoLinkParameters();
  FitOptions options;
  options.profile.levels = levels;
  return Fit(problem, options);
}

// Levels below 1.96 are gone beyond, from the outermost on, in whatever order they are given.
TEST(Profile, OrderOfLevelsDoesNotMatter) {
  const TwoLink model;
  Rng rng(22);
  const Observations data = Record(model, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
  const FitResult up = WithLevels(data, model, {0.4, 1.0}),
                  down = WithLevels(data, model, {1.0, 0.4});
  ASSERT_TRUE(up.Usable()) << up.message;
  for (std::size_t j = 0; j < 2; ++j) {
    const Profile &a = up.parameters[j].profile, &b = down.parameters[j].profile;
    EXPECT_LT(a.low, up.parameters[j].value);
    EXPECT_GT(a.high, up.parameters[j].value);
    ASSERT_EQ(a.points.size(), b.points.size());
    for (std::size_t i = 0; i < a.points.size(); ++i) {
      EXPECT_EQ(a.points[i].value, b.points[i].value);
      EXPECT_EQ(a.points[i].deviance, b.points[i].deviance);
    }
    EXPECT_EQ(a.low, b.low);
    EXPECT_EQ(a.high, b.high);
  }
}

// Least squares written out: the deviance of the first motion's part, the second's not below 0.
struct Bounded {
  explicit Bounded(const AlikeRecord& record) : H(record.H), right(record.right) {}
  Eigen::Matrix3d H;
  Eigen::Vector3d right;
  double Cost(double a, double b) const {  // the third at its best
    const double c = (right(2) - H(2, 0) * a - H(2, 1) * b) / H(2, 2);
    const Eigen::Vector3d x(a, b, c);
    return x.dot(H * x) - 2.0 * x.dot(right);
  }
  double Least(double a) const {
    const double h = H(1, 1) - H(1, 2) * H(1, 2) / H(2, 2);
    const double g =
        right(1) - H(1, 2) * right(2) / H(2, 2) - (H(1, 0) - H(1, 2) * H(2, 0) / H(2, 2)) * a;
    return Cost(a, std::max(0.0, g / h));
  }
  // Where the deviance passes 3.84, from `at` towards `to`.
  double End(double at, double to) const {
    const double least = Least(at);
    double in = at, out = to;
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (in + out);
      (Least(middle) - least < kDeviance95 ? in : out) = middle;
    }
    return in;
  }
};

// The first motion's part may rise only as far as the second's falls to 0, and then the deviance
// rises all at once. The straight line between two points of the profile passed 3.84 far too early:
// of a pendulum's damping, beside a quadratic one of almost nothing, the interval ended at 0.0195,
// with the truth, 0.0200, at a deviance of 0.3.
TEST(Profile, EndsWhereAnotherParameterComesToItsBound) {
  const Eigen::Vector3d truth(1.0, 0.03, 0.5);
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const AlikeRecord record(truth, seed);
    const Bounded exact(record);
    std::vector<Parameter> parameters(3);
    for (std::size_t j = 0; j < 3; ++j) {
      parameters[j].start = truth(static_cast<Eigen::Index>(j)) + 0.05;
      parameters[j].low = j == 1 ? 0.0 : -5.0;
      parameters[j].high = 5.0;
    }
    const FitResult fit = record.FittedBy(std::move(parameters));
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const ParameterEstimate& e = fit.parameters[0];
    if (e.profile.dispersion > 1.0) continue;  // residuals that happen to be no white noise
    const double low = exact.End(e.value, e.value - 2.0), high = exact.End(e.value, e.value + 2.0);
    constexpr double kPart = 0.03;  // of the wider half: a straight line within 1.4 standard errors
    EXPECT_NEAR(e.data95.low, low, kPart * (e.value - low)) << seed;
    EXPECT_NEAR(e.data95.high, high, kPart * (e.value - low)) << seed;
  }
}

}  // namespace
}  // namespace unfurl::correlate::profile_test
