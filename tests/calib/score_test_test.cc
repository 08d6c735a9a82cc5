// The algebra of score tests against fits that are made again with changed data, and against
// triangulation; their level on surveys that the fitted model itself made.
#include "calib/score_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/common_error.h"
#include "calib/trends.h"
#include "measure/triangulate.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::score_test_test {
namespace {

using testing::MakeStudy;
using testing::Study;

#ifndef UNFURL_SLOW_TESTS

// A fit of 80 points with a distance offset that all share, converged to round-off. Data without
// noise: with residuals, a fit's curvature is that of Gauss and Newton only nearly.
class Scores : public ::testing::Test {
 protected:
  void SetUp() override {
    Study study = MakeStudy(31, 80);
    data_ = std::move(study.data);
    data_.p = study.points;
    for (Reading& r : data_.readings) {
      measure::Project(study.truth[static_cast<std::size_t>(r.camera)], study.points.col(r.point),
                       &r.u_px);
    }
    data::Survey survey;
    survey.id = data_.ids;
    survey.p = data_.p;
    survey.station = Eigen::Vector3d(4.0, -3.2, 0.6);
    survey.station_errors = {.distance_offset = 1e-3};
    data_.common = StationErrorsOf(survey, "test");
    RigFit fit = FitRig(data_, {}, "test");
    priors_ = fit.priors;
    fit_ = Solved(data_, fit.bundle);
    const ScoreTest test(data_, priors_, fit_);
    // Of one camera's readings and of the places along x: a line and a wave of the order.
    const Eigen::MatrixXd waves = TimeWaves(data_.points());
    columns_ = DriftOfReadings(data_, test, 1, waves).columns;
    columns_.on_survey.setZero(3 * waves.cols(), data_.points());
    for (Eigen::Index k = 0; k < waves.cols(); ++k) {
      columns_.on_survey.row(3 * k) = 5e-3 * waves.col(k).transpose();
    }
    z_ = Eigen::VectorXd::Zero(waves.cols());
    z_(0) = 0.03;
    z_(3) = -0.02;
  }

  RefinedBundle Solved(const Observations& data, RefinedBundle bundle) const {
    BundleOptions squares;
    squares.loss_width = std::numeric_limits<double>::infinity();
    squares.function_tolerance = 1e-15;
    squares.max_iterations = 300;
    bundle.summary = SolveBundle(data, priors_, bundle.weighting, squares, &bundle.state);
    return bundle;
  }
  Observations Changed(const Columns& columns) const {
    Observations out = data_;
    for (std::size_t k = 0; k < out.readings.size() && columns.on_readings.size() > 0; ++k) {
      out.readings[k].u_px += columns.on_readings.row(static_cast<Eigen::Index>(k)).dot(z_);
    }
    for (Eigen::Index i = 0; i < out.p.cols() && columns.on_survey.size() > 0; ++i) {
      out.p.col(i) += columns.on_survey.col(i).reshaped(3, z_.size()) * z_;
    }
    return out;
  }

  Observations data_;
  std::vector<CameraPrior> priors_;
  RefinedBundle fit_;
  Columns columns_;
  Eigen::VectorXd z_;
};

// A fit to data with z of the columns in them has a score that is larger by M z, and cameras that
// moved by K z.
TEST_F(Scores, FollowAFitThatIsMadeAgain) {
  z_ *= 0.01;  // weak directions of the cameras are curved
  const Observations changed = Changed(columns_);
  const RefinedBundle again = Solved(changed, fit_);
  const ScoreTest::Score before = ScoreTest(data_, priors_, fit_).Of(columns_);
  const ScoreTest::Score after = ScoreTest(changed, priors_, again).Of(columns_);
  const Eigen::VectorXd expected = before.covariance * z_;
  EXPECT_LT((after.value - before.value - expected).norm(), 0.01 * expected.norm());
  // Something is left to test, and much less than were the fit known.
  for (const Eigen::Index k : {0, 3}) {
    EXPECT_GT(before.covariance(k, k), 1e-2 * before.whole(k, k));
    EXPECT_LT(before.covariance(k, k), 0.99 * before.whole(k, k));
  }
  const Eigen::VectorXd moved = before.on_cameras * z_;
  for (std::size_t j = 0; j < again.state.cameras.size(); ++j) {
    const data::RigCamera &a = again.state.cameras[j], &b = fit_.state.cameras[j];
    const Eigen::Index first = data::kCameraParameters * static_cast<Eigen::Index>(j);
    EXPECT_NEAR(a.f_px - b.f_px, moved(first + 6), 0.02 * std::abs(moved(first + 6)) + 1e-5);
    EXPECT_LT((a.p_WC - b.p_WC - moved.segment<3>(first + 3)).norm(),
              0.02 * moved.segment<3>(first + 3).norm() + 1e-8);
  }
  EXPECT_NEAR(again.state.common(0) - fit_.state.common(0), moved(moved.size() - 1),
              0.02 * std::abs(moved(moved.size() - 1)) + 1e-6);
}

// Points found by triangulation with a rig that was fitted to readings with a drift, from readings
// with it.
TEST_F(Scores, RiseOfErrorIsThatOfFoundPoints) {
  columns_.on_survey.resize(0, 0);
  z_ *= 0.1;
  const RefinedBundle again = Solved(Changed(columns_), fit_);
  const ScoreTest test(data_, priors_, fit_);
  const double rise =
      test.RiseOfError(columns_.on_readings, test.Of(columns_).on_cameras, z_ * z_.transpose());
  RigFit rig_fit = FitRig(data_, {}, "test");
  data::Rig rig = rig_fit.rig;
  rig.cameras = again.state.cameras;
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Eigen::Matrix3Xd F(3, triangulator.shared_rank());
  double sum = 0.0, found = 0.0;
  std::size_t k = 0;
  for (int i = 0; i < data_.points(); ++i) {
    std::vector<double> u(rig.cameras.size(), std::numeric_limits<double>::quiet_NaN()),
        s(rig.cameras.size(), 0.05);
    const Eigen::Vector3d p = fit_.state.points.col(i);
    for (; k < data_.readings.size() && data_.readings[k].point == i; ++k) {
      const auto j = static_cast<std::size_t>(data_.readings[k].camera);
      if (!test.Uses(k) || !measure::Project(fit_.state.cameras[j], p, &u[j])) continue;
      u[j] += columns_.on_readings.row(static_cast<Eigen::Index>(k)).dot(z_);
    }
    const auto solution = triangulator.Solve(u, s, p);
    if (solution.outcome != measure::PointOutcome::kSolved) continue;
    triangulator.SharedFactor(solution, s, F);
    const Eigen::Matrix3d C = solution.cov + F * F.transpose();
    const Eigen::Vector3d e = solution.p - p;
    sum += e.dot(C.llt().solve(e)) / 3.0;
    found += 1.0;
  }
  ASSERT_GT(found, 60.0);
  EXPECT_GT(rise, 1e-4);
  EXPECT_NEAR(rise, sum / found, 0.03 * sum / found);
}

constexpr std::size_t kDraws = 60;
#else
constexpr std::size_t kDraws = 2000;
#endif

// Surveys that the model of a fit makes, with normal errors: the level is kept by all tests
// together, and by each.
TEST(TrendsOfTheModelItself, LevelIsKept) {
  const Study study = MakeStudy(41, 100);
  const RigFit fit = FitRig(study.data, {}, "test");
  std::vector<double> least(kDraws), below(kDraws), tests(kDraws);
  ParallelFor(kDraws, 0, [&](std::size_t draw) {
    const Observations data =
        testing::Observe(fit.rig.cameras, study.points, 3e-4, 0.05, Rng(draw).Stream("draw"));
    RefineOptions options;
    options.choose_gross = false;
    const RefinedBundle bundle = Refine(data, fit.priors, EqualWeighting(data, 0.0), options,
                                        {fit.rig.cameras, study.points});
    double smallest = 1.0;
    const std::vector<Trend> trends = TestTrends(data, fit.priors, bundle).trends;
    for (const Trend& trend : trends) {
      smallest = std::min(smallest, trend.chance);
      below[draw] += trend.chance < 0.05 ? 1.0 : 0.0;
      tests[draw] += 1.0;
    }
    least[draw] = 1.0 - std::pow(1.0 - smallest, static_cast<double>(trends.size()));
  });
  double alarms = 0.0, low = 0.0, all = 0.0, fifths = 0.0;
  for (std::size_t k = 0; k < kDraws; ++k) {
    alarms += least[k] < 0.01 ? 1.0 : 0.0;
    fifths += least[k] < 0.2 ? 1.0 : 0.0;
    low += below[k];
    all += tests[k];
  }
  const auto n = static_cast<double>(kDraws);
  std::printf(
      "%.0f surveys: %.2f%% below 1%%, %.1f%% below 20%%; of single tests %.2f%% below 5%%\n", n,
      100.0 * alarms / n, 100.0 * fifths / n, 100.0 * low / all);
  // Four standard deviations of the count; single tests of a survey depend on each other.
  EXPECT_LE(alarms, 0.01 * n + 4.0 * std::sqrt(0.01 * n));
  EXPECT_NEAR(fifths, 0.2 * n, 4.0 * std::sqrt(0.16 * n));
  EXPECT_NEAR(low / all, 0.05, 4.0 * std::sqrt(0.05 / all) * std::sqrt(2.0));
}

}  // namespace
}  // namespace unfurl::calib::score_test_test
