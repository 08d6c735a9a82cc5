// What a total station does to all points alike: estimated where the readings tell, carried in the
// covariance where they do not.
#include "calib/common_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "calib/check.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::common_error_test {
namespace {

using testing::CheckPoints;
using testing::ErrorsOf;
using testing::MakeRig;
using testing::MakeStudy;
using testing::Observe;
using testing::PointsInCube;
using testing::Study;

constexpr Eigen::Index kParameters = data::kCameraParameters;
// Of a camera, in fits that the ten usual terms suffice for.
[[maybe_unused]] constexpr double kTakePart = data::kFirstTerm + 10;
const Eigen::Vector3d kStation(4.0, -3.2, 0.6);

// As a station with wrong distances has them: d becomes (1 + scale) d + offset, the zenith angle
// grows by `zenith`.
Eigen::Matrix3Xd Mismeasured(const Eigen::Matrix3Xd& p, double offset, double scale,
                             double zenith) {
  Eigen::Matrix3Xd out = p;
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Eigen::Vector3d way = p.col(i) - kStation;
    const double level = std::hypot(way.x(), way.y()), v = std::atan2(level, way.z()) + zenith;
    const double d = way.norm() * (1.0 + scale) + offset;
    out.col(i) = kStation + d * Eigen::Vector3d(std::sin(v) * way.x() / level,
                                                std::sin(v) * way.y() / level, std::cos(v));
  }
  return out;
}

data::Survey Stated(const Observations& data, const data::StationErrors& errors) {
  data::Survey survey;
  survey.id = data.ids;
  survey.p = data.p;
  survey.station = kStation;
  survey.station_errors = errors;
  return survey;
}

// The frame is the survey's: the truth as seen from there is the truth moved rigidly onto the
// mismeasured points (Kabsch).
Eigen::Isometry3d OntoSurvey(const Eigen::Matrix3Xd& truth, const Eigen::Matrix3Xd& surveyed) {
  return Eigen::Isometry3d(Eigen::umeyama(truth, surveyed, false));
}

#ifndef UNFURL_SLOW_TESTS

TEST(CommonError, IsWhatTheStationDoesLessARigidMotion) {
  const Eigen::Matrix3Xd p = PointsInCube(50, 1.1, Rng(1));
  data::Survey survey;
  survey.id.assign(50, "p");
  survey.p = p;
  survey.station = kStation;
  survey.station_errors = {.distance_offset = 1e-4, .distance_scale = 3e-5, .zenith = 2e-5};
  const auto errors = StationErrorsOf(survey, "test");
  ASSERT_EQ(errors.size(), 3U);
  const double sizes[3][3] = {{1e-4, 0.0, 0.0}, {0.0, 3e-5, 0.0}, {0.0, 0.0, 2e-5}};
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Matrix3Xd moved = Mismeasured(p, sizes[k][0], sizes[k][1], sizes[k][2]);
    const Eigen::Isometry3d frame = OntoSurvey(p, moved);
    const Eigen::Matrix3Xd left = moved - frame * p;
    // Second order in shifts of 1e-4 m over some meters.
    EXPECT_LT((errors[k].shift - left).cwiseAbs().maxCoeff(), 3e-8) << errors[k].name;
    EXPECT_GT(left.cwiseAbs().maxCoeff(), 1e-6);
  }
  survey.station.setConstant(NAN);
  EXPECT_THROW(StationErrorsOf(survey, "test"), Error);
  survey.station_errors = {};
  EXPECT_TRUE(StationErrorsOf(survey, "test").empty());
}

// Second formulation: the whole normal matrix of cameras, common errors and points, dense.
TEST(CommonError, CovarianceEqualsTheCornerOfTheWholeInverse) {
  const Study study = MakeStudy(1, 30);
  Observations data = study.data;
  data.common = StationErrorsOf(
      Stated(data, {.distance_offset = 2e-3, .distance_scale = 1e-4, .zenith = 1e-4}), "test");
  const RigFit fit = FitRig(data, {}, "test");
  const Eigen::Index c = 4 * kParameters, m = 3, n = data.p.cols();
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(c + m + 3 * n, c + m + 3 * n);
  whole.topLeftCorner(c, c) = PriorInformation(fit.priors);
  // And the bundle's own: u0 in the row's middle, to a tenth of it.
  for (Eigen::Index j = 0; j < 4; ++j) {
    whole(kParameters * j + 7, kParameters * j + 7) += std::pow(0.1 * testing::kPixels, -2);
  }
  whole.block(c, c, m, m).setIdentity();
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, whole.cols());
    for (Eigen::Index k = 0; k < m; ++k) {
      rows.col(c + k) = data.common[static_cast<std::size_t>(k)].shift.col(i);
    }
    rows.middleCols<3>(c + m + 3 * i).setIdentity();
    whole += fit.bundle.summary.survey_weight[static_cast<std::size_t>(i)] * rows.transpose() *
             data.cov[static_cast<std::size_t>(i)].inverse() * rows;
  }
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const Reading& r = data.readings[k];
    measure::Projection h;
    ASSERT_TRUE(measure::Project(fit.rig.cameras[static_cast<std::size_t>(r.camera)],
                                 fit.bundle.state.points.col(r.point), &h));
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(whole.cols());
    for (int t = 0; t < static_cast<int>(data::kLensTerms); ++t) {  // terms that are held
      if (fit.priors[static_cast<std::size_t>(r.camera)].Fixed(t)) {
        h.du_dc(data::kFirstTerm + t) = 0.0;
      }
    }
    row.segment<kParameters>(kParameters * r.camera) = h.du_dc;
    row.segment<3>(c + m + 3 * r.point) = h.du_dp;
    whole += fit.bundle.summary.reading_weight[k] / fit.bundle.weighting.Variance(r) *
             row.transpose() * row;
  }
  const Eigen::VectorXd scale = whole.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse =
      scale.asDiagonal() * (scale.asDiagonal() * whole * scale.asDiagonal())
                               .eval()
                               .ldlt()
                               .solve(Eigen::MatrixXd(scale.asDiagonal()));
  const Eigen::MatrixXd corner = inverse.topLeftCorner(c + m, c + m);
  const Eigen::VectorXd sigma = corner.diagonal().cwiseSqrt();
  const Eigen::MatrixXd ours = CameraCovariance(fit.bundle.summary.information);
  ASSERT_EQ(ours.rows(), c + m);
  EXPECT_LT((ours - corner).cwiseQuotient(sigma * sigma.transpose()).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_EQ(fit.rig.covariance.rows(), c);
  // Redundancy by its definition: each datum's 1 - (variance of the fitted) / (its own), summed, is
  // the number of data less that of unknowns, the priors counting as data.
  double sum = 0.0;
  for (const double r : fit.bundle.redundancy.reading) sum += r;
  for (const double r : fit.bundle.redundancy.survey) sum += r;
  EXPECT_NEAR(sum, fit.bundle.summary.degrees_of_freedom, 0.5);
}

// A prism constant of 34.4 mm that all points share, in a survey that states 1 mm: to first order
// it is a stretch that no reading tells, to second order it is told to some 3 mm.
TEST(CommonError, APrismConstantOfAllPointsIsTold) {
  const Study study = MakeStudy(4, 200);
  Observations data = study.data;
  const Eigen::Matrix3Xd moved = Mismeasured(study.points, 34.4e-3, 0.0, 0.0);
  data.p += moved - study.points;
  data.common = StationErrorsOf(Stated(data, {.distance_offset = 1e-3}), "test");
  const Calibration warned = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_NE(warned.rig.verdict, "good");
  EXPECT_THAT(warned.rig.reasons, ::testing::Contains(::testing::HasSubstr("prism constant")));
  data.common = StationErrorsOf(Stated(data, {.distance_offset = 50e-3}), "test");
  const Calibration told = Calibrate(data, {.order = kFullOrder}, "test");
  ASSERT_EQ(told.report.common.size(), 1U);
  EXPECT_LT(told.report.common[0].sigma, 5e-3);
  EXPECT_NEAR(told.report.common[0].value, 34.4e-3, 3.0 * told.report.common[0].sigma);
}

// Ten points measured from another set-up with the same kind of prism: their own common error is in
// what is expected of them.
TEST(CommonError, ACheckAllowsForIt) {
  const Study study = MakeStudy(41);
  const data::Rig rig = FitRig(study.data, {}, "test").rig;
  const Eigen::Matrix3Xd places = PointsInCube(10, 0.9, Rng(5));
  Observations ten = Observe(study.truth, places, 1e-4, 0.05, Rng(6));
  const Eigen::Matrix3Xd moved = Mismeasured(places, 6e-3, 0.0, 0.0);
  ten.p += moved - OntoSurvey(places, moved) * places;
  EXPECT_NE(CheckPoints(rig, ten, "test").verdict, "still valid");
  ten.common = StationErrorsOf(Stated(ten, {.distance_offset = 4e-3}), "test");
  EXPECT_EQ(CheckPoints(rig, ten, "test").verdict, "still valid");
}

#endif  // UNFURL_SLOW_TESTS

struct Scatter {
  double nees = 0.0, nees_error = 0.0, rms = 0.0, predicted = 0.0, held_out = 0.0;
};

// Surveys of one laboratory, each with a common error drawn from what is stated, and what the rig
// says of found points against where they are in the survey's frame.
Scatter Repeat(std::size_t repeats, int points, const data::StationErrors& drawn,
               const data::StationErrors& stated, bool with_held_out) {
  const Study study = MakeStudy(3, points);
  const Eigen::Matrix3Xd check = CheckPoints(3, 12);
  std::vector<double> nees(repeats), squares(repeats), predicted(repeats), held_out(repeats),
      estimate(repeats);
  ParallelFor(repeats, 0, [&](std::size_t k) {
    Rng rng = Rng(3).Stream("repeat", k);
    Observations data = Observe(study.truth, study.points, 3e-4, 0.05, rng.Stream("noise"));
    const Eigen::Matrix3Xd moved =
        Mismeasured(study.points, drawn.distance_offset * rng.Normal(),
                    drawn.distance_scale * rng.Normal(), drawn.zenith * rng.Normal());
    data.p += moved - study.points;
    data.common = StationErrorsOf(Stated(data, stated), "test");
    CalibrateOptions options;
    options.workers = 1;
    options.order = kFullOrder;
    data::Rig rig;
    if (with_held_out) {
      const Calibration result = Calibrate(data, options, "test");
      rig = result.rig;
      held_out[k] = rig.checks.at("held_out_nees_per_dof [1]");
    } else {
      rig = FitRig(data, options, "test").rig;
    }
    // Cameras and check points as the survey's frame has them.
    const Eigen::Isometry3d frame = OntoSurvey(study.points, moved);
    std::vector<data::RigCamera> truth = study.truth;
    for (auto& camera : truth) {
      camera.R_CW = camera.R_CW * frame.linear().transpose();
      camera.p_WC = frame * camera.p_WC;
    }
    const auto errors = ErrorsOf(rig, truth, frame * check);
    const auto n = static_cast<double>(errors.error.size());
    for (std::size_t i = 0; i < errors.error.size(); ++i) {
      nees[k] += errors.error[i].dot(errors.predicted[i].ldlt().solve(errors.error[i])) / (3.0 * n);
    }
    squares[k] = errors.Rms() * errors.Rms();
    predicted[k] = errors.PredictedRms() * errors.PredictedRms();
  });
  return {Mean(nees), std::sqrt(Variance(nees) / static_cast<double>(repeats)),
          std::sqrt(Mean(squares)), std::sqrt(Mean(predicted)), Mean(held_out)};
}

constexpr data::StationErrors kDrawn = {
    .distance_offset = 1e-3, .distance_scale = 1e-4, .zenith = 1e-4};

void ExpectHonest(std::size_t repeats, int points, bool with_held_out) {
  const Scatter told = Repeat(repeats, points, kDrawn, kDrawn, with_held_out);
  const Scatter untold = Repeat(repeats, points, kDrawn, {}, false);
  std::printf(
      "stated: NEES/3 %.3f +- %.3f, %.3f mm RMS, predicted %.3f mm; held-out points' %.3f\n"
      "not stated: NEES/3 %.3f +- %.3f, %.3f mm RMS, predicted %.3f mm\n",
      told.nees, told.nees_error, 1e3 * told.rms, 1e3 * told.predicted, told.held_out, untold.nees,
      untold.nees_error, 1e3 * untold.rms, 1e3 * untold.predicted);
  // As in covariance_test: floors are raised by chance and never lowered.
  const double dof = 4.0 * points - 4.0 * kTakePart;
  const double cautious = 0.8 * std::sqrt(2.0 / dof);
  EXPECT_LT(told.nees, 1.0 + 4.0 * told.nees_error);
  EXPECT_GT(told.nees, 1.0 - cautious - 4.0 * told.nees_error);
  // What is not stated is not in the error bars: 1 mm, 0.1 mm/m and 0.1 mrad are as much as 0.3 mm
  // of each point are for the rig.
  EXPECT_GT(untold.nees, 1.2);
  // In the survey's own frame the common error cancels: held-out points must not be told apart.
  if (with_held_out) {
    EXPECT_NEAR(told.held_out, 1.0, 0.05);
  }
}

#ifdef UNFURL_SLOW_TESTS
TEST(CommonErrorMonteCarlo, ErrorBarsAreTrueOverManySurveys) { ExpectHonest(500, 200, true); }
#else
TEST(CommonErrorMonteCarlo, ErrorBarsAreTrue) { ExpectHonest(24, 80, false); }
#endif

}  // namespace
}  // namespace unfurl::calib::common_error_test
