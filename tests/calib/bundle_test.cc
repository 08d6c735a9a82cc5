#include "calib/bundle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "base/statistics.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::bundle_test {
namespace {

using testing::CheckPoints;
using testing::ErrorsOf;
using testing::MakeRig;
using testing::MakeStudy;
using testing::Observe;
using testing::PointsInCube;

// Readings and survey without noise, of cameras with all ten terms: nothing but the weak priors
// keeps the fit from the truth. Stated sigmas of 1e-3 px and 1e-6 m make those count as 1e-10 of
// the data's weight, which leaves some 1e-9 m; a term wrongly derived or left out leaves 1e-4 m or
// more.
TEST(Bundle, RecoversNoiseFreeDataFromNoGuess) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Rng rng(seed);
    const auto truth = MakeRig({.f_spread = 0.2, .pose_error = 0.05}, rng.Stream("rig"));
    Observations data = Observe(truth, PointsInCube(150, 1.1, rng.Stream("points")), 0.0, 0.0, rng);
    for (Reading& r : data.readings) r.s_px = 1e-3;
    for (Eigen::Matrix3d& cov : data.cov) cov = 1e-12 * Eigen::Matrix3d::Identity();
    const RigFit fit = FitRig(data, {}, "test");
    EXPECT_EQ(fit.rig.model_floor_px, 0.0);
    const auto errors = ErrorsOf(fit.rig, truth, CheckPoints(seed));
    ASSERT_GT(errors.error.size(), 100U);
    EXPECT_LT(errors.Rms(), 1e-7) << "seed " << seed;
    for (std::size_t j = 0; j < truth.size(); ++j) {
      EXPECT_NEAR(fit.rig.cameras[j].f_px, truth[j].f_px, 0.05) << "seed " << seed;
    }
  }
}

// Held at the surveyed points, each camera is a problem of its own, and has the same answer.
TEST(Bundle, FixedPointsRecoverNoiseFreeCameras) {
  const Rng rng(5);
  const auto truth = MakeRig({}, rng.Stream("rig"));
  Observations data = Observe(truth, PointsInCube(150, 1.1, rng.Stream("points")), 0.0, 0.0, rng);
  for (Reading& r : data.readings) r.s_px = 1e-3;
  for (Eigen::Matrix3d& cov : data.cov) cov = 1e-12 * Eigen::Matrix3d::Identity();
  const auto guesses = GuessCameras(data, {}, "test");
  for (const Reading& r : data.readings) {
    double u = 0.0;
    ASSERT_TRUE(measure::Project(guesses[static_cast<std::size_t>(r.camera)].camera,
                                 data.p.col(r.point), &u));
    EXPECT_NEAR(u, r.u_px, 1e-5);
  }
}

TEST(Bundle, LossIsSquaredInTheCoreAndItsSlopeContinues) {
  constexpr double kWidth = 3.0;
  EXPECT_EQ(Loss(4.0, kWidth), 4.0);
  EXPECT_EQ(LossWeight(4.0, kWidth), 1.0);
  for (double s : {0.5, 8.0, 10.0, 100.0, 1e4}) {
    const double h = 1e-6 * s;
    const double slope = (Loss(s + h, kWidth) - Loss(s - h, kWidth)) / (2.0 * h);
    EXPECT_NEAR(slope, LossWeight(s, kWidth), 1e-6);
  }
  // A reading of r sigmas pulls with weight * r: beyond the core ever less.
  EXPECT_LT(LossWeight(1e4, kWidth) * 100.0, 0.1);
}

TEST(Bundle, SurveyLossLeavesTheSameShareOutside) {
  const double width = SurveyLossWidth(3.0);
  EXPECT_NEAR(ChiSquareTail(width * width, 3.0), 2.0 * 0.00134989803, 1e-9);  // normal tail at 3
}

// The fit of a rotated and shifted survey is the rotated and shifted fit.
TEST(Bundle, DoesNotDependOnTheSurveysFrame) {
  const auto study = MakeStudy(6, 100);
  Observations moved = study.data;
  const Eigen::Matrix3d R = RotationFromVector({0.4, -1.1, 0.7});
  const Eigen::Vector3d t(120.0, -35.0, 8.0);
  moved.p = (R * moved.p).colwise() + t;
  const RigFit here = FitRig(study.data, {}, "test"), there = FitRig(moved, {}, "test");
  for (std::size_t j = 0; j < here.rig.cameras.size(); ++j) {
    const data::RigCamera &a = here.rig.cameras[j], &b = there.rig.cameras[j];
    // Converged to 1e-10 of the cost, not to round-off: a few hundredths of a sigma.
    const double f_sigma =
        std::sqrt(here.rig.covariance(data::kCameraParameters * static_cast<Eigen::Index>(j) + 6,
                                      data::kCameraParameters * static_cast<Eigen::Index>(j) + 6));
    EXPECT_NEAR(a.f_px, b.f_px, 0.05 * f_sigma);
    EXPECT_LT((R * a.p_WC + t - b.p_WC).norm(), 2e-4);
  }
  Eigen::Matrix3Xd check = CheckPoints(6);
  auto truth = study.truth;
  const auto errors = ErrorsOf(here.rig, truth, check);
  for (auto& camera : truth) {
    camera.R_CW = camera.R_CW * R.transpose();
    camera.p_WC = R * camera.p_WC + t;
  }
  check = (R * check).colwise() + t;
  EXPECT_NEAR(ErrorsOf(there.rig, truth, check).Rms(), errors.Rms(), 0.02 * errors.Rms());
}

// A search that is out of iterations has converged where nothing that matters is left to win, and
// nowhere else. What is left is known from a search without an end.
TEST(Bundle, ConvergedIsWithinATenthOfAStandardError) {
  const auto study = MakeStudy(8, 60);
  const std::vector<CameraGuess> guesses = GuessCameras(study.data, {}, "test");
  BundleState start;
  start.points = study.data.p;
  std::vector<CameraPrior> priors;
  for (const CameraGuess& guess : guesses) {
    priors.push_back(guess.prior);
    start.cameras.push_back(guess.camera);
  }
  BundleOptions options;
  options.loss_width = std::numeric_limits<double>::infinity();
  options.function_tolerance = 1e-300;  // no search ends by it
  const Weighting weighting = EqualWeighting(study.data, 0.0);
  BundleState best = start;
  const double least = SolveBundle(study.data, priors, weighting, options, &best).chi_square;
  double far = 0.0, near = 0.0;
  for (options.max_iterations = 1; options.max_iterations <= 20; ++options.max_iterations) {
    BundleState state = start;
    const BundleSummary summary = SolveBundle(study.data, priors, weighting, options, &state);
    const double left = summary.chi_square - least;
    if (summary.converged) {
      near = left;
      EXPECT_EQ(summary.iterations, options.max_iterations + 1);  // the start is counted
      break;
    }
    far = left;
  }
  EXPECT_LT(options.max_iterations, 20);
  EXPECT_GT(far, 0.01);
  EXPECT_LT(std::abs(near), 0.01);
}

// A solver that cannot go on says so in its summary, and not on the user's terminal.
TEST(Bundle, AFailureIsDataAndNotALogLine) {
  const auto study = MakeStudy(3, 30);
  BundleState state{study.truth, study.data.p};
  std::vector<CameraPrior> priors(study.truth.size());
  for (CameraPrior& prior : priors) prior.term_sigma_px.fill(100.0);
  priors[0].e_mean = std::nan("");
  ::testing::internal::CaptureStderr();
  const BundleSummary summary =
      SolveBundle(study.data, priors, EqualWeighting(study.data, 0.0), {}, &state);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_FALSE(summary.converged);
}

}  // namespace
}  // namespace unfurl::calib::bundle_test
