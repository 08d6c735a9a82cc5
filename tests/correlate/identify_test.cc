// Profiles, and which parameters a trial does not tell apart.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/correlate/identify_cases.h"

namespace unfurl::correlate::identify_test {
namespace {

TEST(Identify, HiddenSetsAreNamedAndNothingElse) {
  constexpr int kSeeds = 2;  // the slow test has hundreds
  for (const IdentifyCase& which : IdentifyCases()) {
    const IdentifyCount count = CountIdentified(which, kSeeds, 500);
    EXPECT_EQ(count.named, count.should) << which.name << ": " << count.first_miss;
    EXPECT_EQ(count.false_alarms, 0) << which.name << ": " << count.first_miss;
  }
}

// Marks that depend on the parameters linearly: three known motions, so many of each.
class Linear : public Model {
 public:
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
      motion.p = motion.v = Eigen::Matrix3Xd::Zero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        motion.p.col(i) = Base(m, t);
        for (std::size_t j = 0; j < theta.size(); ++j) motion.p.col(i) += theta[j] * Shape(j, m, t);
      }
      out.marks.push_back(std::move(motion));
    }
    return out;
  }
  static Eigen::Vector3d Base(std::size_t m, double t) {
    return {std::cos(2.0 * t + static_cast<double>(m)), std::sin(3.0 * t), 0.0};
  }
  static Eigen::Vector3d Shape(std::size_t j, std::size_t m, double t) {
    const double phase = static_cast<double>(m);
    if (j == 0) return {std::sin(5.0 * t + phase), 0.2 * t, 0.0};
    if (j == 1) return {std::sin(5.0 * t + phase + 0.4), std::cos(4.0 * t), 0.0};
    return {0.0, t * t, 0.1 * t};
  }
};

TEST(Identify, TheProfileOfALinearModelIsTheAnalyticOne) {
  const Linear model;
  Trial trial;
  trial.duration = 3.0;
  trial.step = 0.02;
  trial.before = 0.0;
  trial.sigma = 2e-3;
  Rng rng(3);
  const std::vector<double> truth = {0.3, -0.2, 0.1};
  const Observations data = Record(model, truth, {"a", "b"}, trial, rng);
  FitProblem problem;
  problem.parameters = {Named("p", 0.25, -5.0, 5.0), Named("q", -0.25, -5.0, 5.0),
                        Named("r", 0.12, -5.0, 5.0)};
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;

  // Least squares written out, with frame and clock known.
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t m = 0; m < 2; ++m) {
    for (std::size_t i = 0; i < data.marks[m].size(); ++i) {
      const double t = data.marks[m].t[i];
      Eigen::Matrix3d rows;
      for (std::size_t j = 0; j < 3; ++j) {
        rows.col(static_cast<Eigen::Index>(j)) = Linear::Shape(j, m, t) / trial.sigma;
      }
      H += rows.transpose() * rows;
      right += rows.transpose() *
               (data.marks[m].p.col(static_cast<Eigen::Index>(i)) - Linear::Base(m, t)) /
               trial.sigma;
    }
  }
  const Eigen::Matrix3d covariance = H.inverse();
  const Eigen::Vector3d estimate = covariance * right;

  const auto workers = LocalWorkers(2);
  Evaluator evaluator(problem, *workers);
  evaluator.SetStamps({data.StampsAt(0.0)}, 0);
  RegistrationOptions known;
  known.fit_frame = known.fit_offset = false;
  ReducedProblem reduced({{0, &data, 0.0, Registration{}, nullptr}}, known, evaluator);
  ProfileStart start;
  start.u = {estimate(0), estimate(1), estimate(2)};
  ASSERT_TRUE(reduced.At(start.u, &start.point, "trial"));
  ASSERT_TRUE(reduced.CentralSensitivity(start.u, start.point, &start.projected));
  start.sigma = covariance.diagonal().cwiseSqrt();
  start.dispersion = Eigen::Vector3d::Ones();
  ProfileOptions options;
  options.levels = {0.5, 1.0, 2.0, 3.0};
  const std::vector<Profile> profiles = Profiles(reduced, start, options);
  constexpr double kPart = 0.01;  // issue: of the interval's half width, and of the deviance
  for (std::size_t j = 0; j < 3; ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    const double half = 1.959964 * start.sigma(c);
    ASSERT_TRUE(profiles[j].closed());
    EXPECT_NEAR(profiles[j].high - estimate(c), half, kPart * half);
    EXPECT_NEAR(estimate(c) - profiles[j].low, half, kPart * half);
    EXPECT_EQ(profiles[j].points.size(), 9u);
    for (const ProfilePoint& point : profiles[j].points) {
      const double z = (point.value - estimate(c)) / start.sigma(c);
      EXPECT_NEAR(point.deviance, z * z, kPart * std::max(1.0, z * z)) << "parameter " << j;
    }
  }
}

TEST(Identify, AParameterWithoutEffectIsNotDetermined) {
  IdentifyCase which = IdentifyCases()[0];
  which.parameters[1] = Named("idle", 1.5, 0.1, 2.0);
  which.to_two_link = [](std::span<const double> x) {
    return std::vector<double>{1.5 * x[0], x[2], 0.0};
  };
  const Mapped model(which);
  Rng rng(12);
  const Observations data = Record(model, which.truth, TwoLink::Marks(), SparseTrial(), rng);
  FitProblem problem;
  problem.parameters = which.parameters;
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  const FitResult fit = Fit(problem);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.parameters[1].verdict, Verdict::kNotDetermined) << fit.parameters[1].reason;
  EXPECT_TRUE(fit.parameters[1].with.empty());
  EXPECT_EQ(fit.parameters[0].verdict, Verdict::kDetermined) << fit.parameters[0].reason;
}

}  // namespace
}  // namespace unfurl::correlate::identify_test
