#include "calib/covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::covariance_test {
namespace {

using testing::CheckPoints;
using testing::ErrorsOf;
using testing::MakeStudy;
using testing::Observe;
using testing::Study;

// Of a camera, in fits that the ten usual terms suffice for.
[[maybe_unused]] constexpr double kTakePart = data::kFirstTerm + 10;

#ifndef UNFURL_SLOW_TESTS
constexpr Eigen::Index kParameters = data::kCameraParameters;

// Second formulation: the whole normal matrix of cameras and points, dense, inverted; its corner is
// the cameras' covariance.
TEST(Covariance, EqualsTheCornerOfTheWholeInverse) {
  const Study study = MakeStudy(1, 30);
  const RigFit fit = FitRig(study.data, {}, "test");
  const Eigen::Index c = 4 * kParameters, n = study.data.p.cols();
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(c + 3 * n, c + 3 * n);
  whole.topLeftCorner(c, c) = PriorInformation(fit.priors);
  constexpr Eigen::Index kOffset = 7;  // u0: the row's middle, to a tenth of the row
  for (Eigen::Index j = 0; j < 4; ++j) {
    const double sigma = 0.1 * fit.rig.cameras[static_cast<std::size_t>(j)].pixels;
    whole(kParameters * j + kOffset, kParameters * j + kOffset) += 1.0 / (sigma * sigma);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    whole.block<3, 3>(c + 3 * i, c + 3 * i) +=
        fit.bundle.summary.survey_weight[static_cast<std::size_t>(i)] *
        study.data.cov[static_cast<std::size_t>(i)].inverse();
  }
  for (std::size_t k = 0; k < study.data.readings.size(); ++k) {
    const Reading& r = study.data.readings[k];
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
    row.segment<3>(c + 3 * r.point) = h.du_dp;
    whole += fit.bundle.summary.reading_weight[k] / fit.bundle.weighting.Variance(r) *
             row.transpose() * row;
  }
  const Eigen::VectorXd scale = whole.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd inverse =
      scale.asDiagonal() * (scale.asDiagonal() * whole * scale.asDiagonal())
                               .eval()
                               .ldlt()
                               .solve(Eigen::MatrixXd(scale.asDiagonal()));
  Eigen::MatrixXd corner = inverse.topLeftCorner(c, c);
  const Eigen::VectorXd sigma = corner.diagonal().cwiseSqrt();
  ClearFixed(fit.priors, &corner);
  const Eigen::MatrixXd difference =
      (fit.rig.covariance - corner).cwiseQuotient(sigma * sigma.transpose());
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-5);  // condition 1e9 of the scaled matrix
}

// What is left over of all data together is their number less the parameters', of which the priors
// carry what the data do not: tr(C P). For the last point as for the first: odd and even numbers.
TEST(Redundancy, AddsUpToTheDegreesOfFreedom) {
  for (const int points : {30, 31}) {
    const Study study = MakeStudy(3, points);
    const RigFit fit = FitRig(study.data, {}, "test");
    const std::vector<double> readings(study.data.readings.size(), 1.0);
    const std::vector<double> survey(static_cast<std::size_t>(points), 1.0);
    const Eigen::MatrixXd prior = PriorInformation(fit.priors);
    const Eigen::MatrixXd C =
        CameraCovariance(prior + DataInformation(study.data, fit.priors, fit.bundle.weighting,
                                                 false, fit.bundle.state, readings, survey));
    const Redundancy left =
        RedundancyOf(study.data, fit.priors, fit.bundle.weighting, fit.bundle.state, C);
    double sum = 0.0;
    for (const double r : left.reading) sum += r;
    for (const double r : left.survey) sum += r;
    const double data = static_cast<double>(readings.size()) + 3.0 * points;
    const double unknowns = static_cast<double>(C.rows()) + 3.0 * points;
    EXPECT_NEAR(sum, data - unknowns + C.cwiseProduct(prior).sum(), 1e-4 * data) << points;
  }
}

TEST(Covariance, IsSymmetricAndPositiveSemidefinite) {
  const RigFit fit = FitRig(MakeStudy(2, 60).data, {}, "test");
  const Eigen::VectorXd scale = fit.rig.covariance.diagonal().unaryExpr(
      [](double v) { return v > 0.0 ? 1.0 / std::sqrt(v) : 0.0; });  // 0: a term that is held
  const Eigen::MatrixXd scaled = scale.asDiagonal() * fit.rig.covariance * scale.asDiagonal();
  EXPECT_LT((scaled - scaled.transpose()).cwiseAbs().maxCoeff(), 1e-14);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  EXPECT_GT(eigen.eigenvalues()(0), -1e-12);
  // Cameras share the points' survey noise: they are not independent.
  EXPECT_GT(scaled.block(0, kParameters, kParameters, kParameters).cwiseAbs().maxCoeff(), 0.01);
}

#endif  // UNFURL_SLOW_TESTS

// Re-calibrates one laboratory with fresh noise, and holds what the rig's covariance says of found
// points against how they scatter about the truth. In the space of points, because parameters have
// directions that only the priors hold.
void ExpectHonest(std::size_t repeats, int survey_points) {
  const Study study = MakeStudy(3, survey_points);
  const Eigen::Matrix3Xd check = CheckPoints(3, 12);
  std::vector<double> nees(repeats), squares(repeats), predicted(repeats);
  std::vector<std::vector<bool>> inside(repeats);
  const double limit = ChiSquareQuantile(0.95, 3.0);
  ParallelFor(repeats, 0, [&](std::size_t k) {
    const Observations data =
        Observe(study.truth, study.points, 3e-4, 0.05, Rng(3).Stream("repeat", k));
    const auto errors = ErrorsOf(FitRig(data, {}, "test").rig, study.truth, check);
    const auto m = static_cast<double>(errors.error.size());
    for (std::size_t i = 0; i < errors.error.size(); ++i) {
      const double d = errors.error[i].dot(errors.predicted[i].ldlt().solve(errors.error[i]));
      nees[k] += d / (3.0 * m);
      squares[k] += errors.error[i].squaredNorm();
      predicted[k] += errors.predicted[i].trace();
      inside[k].push_back(d < limit);
    }
  });
  // Points of one calibration share its error, so the repeats alone are independent. The mean's
  // standard error is taken from their own scatter.
  const double error = std::sqrt(Variance(nees) / static_cast<double>(repeats));
  EXPECT_LT(error, 0.1);
  // The floor is raised where chi-square lies above its mean by chance, and never lowered below
  // zero: 0.4 of its standard deviation on average is too much variance. Twice that is allowed for.
  const double dof = 4.0 * survey_points - 4.0 * kTakePart;
  const double cautious = 0.8 * std::sqrt(2.0 / dof);
  EXPECT_GT(Mean(nees), 1.0 - cautious - 4.0 * error);
  EXPECT_LT(Mean(nees), 1.0 + 4.0 * error);
  const double ratio = std::sqrt(Mean(squares) / Mean(predicted));
  EXPECT_GT(ratio, 1.0 - 0.5 * (cautious + 4.0 * error));
  EXPECT_LT(ratio, 1.0 + 0.5 * 4.0 * error);
  std::vector<double> covered;
  for (const auto& points : inside) {
    double share = 0.0;
    for (const bool in : points) share += in ? 1.0 : 0.0;
    covered.push_back(share / static_cast<double>(points.size()));
  }
  const double share_error = std::sqrt(Variance(covered) / static_cast<double>(repeats));
  // A variance too large by 1% adds 0.0017 to the coverage of a 95% region of three dimensions.
  EXPECT_GT(Mean(covered), 0.95 - 4.0 * share_error);
  EXPECT_LT(Mean(covered), 0.95 + 0.2 * cautious + 4.0 * share_error);
  std::printf("mean NEES/3 %.3f +- %.3f, coverage of 95%% regions %.3f +- %.3f\n", Mean(nees),
              error, Mean(covered), share_error);
}

#ifdef UNFURL_SLOW_TESTS
TEST(CovarianceMonteCarlo, CoversFoundPointsOverAThousandCalibrations) { ExpectHonest(1000, 200); }
#else
TEST(CovarianceMonteCarlo, CoversFoundPoints) { ExpectHonest(60, 80); }
#endif

}  // namespace
}  // namespace unfurl::calib::covariance_test
