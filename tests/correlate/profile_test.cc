// Profiles of the cost along each parameter.
#include "correlate/fit/profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"
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

// A sum of three motions, two of them much alike.
class Sum : public Model {
 public:
  static double Of(int motion, double t) {
    const double c = std::cos(2.0 * t), s = std::sin(5.0 * t);
    return motion == 0 ? c : motion == 1 ? c + 0.1 * s : std::cos(3.0 * t);
  }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        for (int j = 0; j < 3; ++j) {
          values(i) += theta[static_cast<std::size_t>(j)] * Of(j, q.t[static_cast<std::size_t>(i)]);
        }
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

// Least squares written out: the deviance of the first motion's part, the second's not below 0.
struct Bounded {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
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
  const Sum model;
  constexpr double kSigma = 0.3;  // with it the parts are known to 0.2 together, to 0.02 alone
  const double truth[] = {1.0, 0.03, 0.5};
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Rng rng(seed);
    ChannelRecord r;
    r.name = r.quantity = "sum";
    r.unit = "rad";
    r.y.resize(400);
    r.sigma = Eigen::VectorXd::Constant(400, kSigma);
    Bounded exact;
    for (Eigen::Index i = 0; i < 400; ++i) {
      r.t.push_back(0.03 * static_cast<double>(i + 1));
      Eigen::Vector3d row;
      for (int j = 0; j < 3; ++j) row(j) = Sum::Of(j, r.t.back());
      r.y(i) = row.dot(Eigen::Vector3d(truth[0], truth[1], truth[2])) + kSigma * rng.Normal();
      exact.H += row * row.transpose() / (kSigma * kSigma);
      exact.right += row * r.y(i) / (kSigma * kSigma);
    }
    Observations data;
    data.others = {std::make_shared<Channel>(std::move(r))};
    data.placement.offset = Prior::Known(0.0);
    FitProblem problem;
    problem.parameters.resize(3);
    for (std::size_t j = 0; j < 3; ++j) {
      problem.parameters[j].name = std::string("part ") + "abc"[j];
      problem.parameters[j].start = truth[j] + 0.05;
      problem.parameters[j].low = j == 1 ? 0.0 : -5.0;
      problem.parameters[j].high = 5.0;
    }
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    FitOptions options;
    options.whiten = options.robust = false;
    options.workers = 1;
    const FitResult fit = Fit(problem, options);
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
