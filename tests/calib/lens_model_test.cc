#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "tests/calib/fixtures.h"

// Wide-angle cameras whose true image is not the fitted model's: equisolid, 2 f sin(a / 2) of the
// angle of incidence a, written out here from the angle itself.
namespace unfurl::calib::lens_model_test {
namespace {

using testing::kPixels;

constexpr double kDistance =
    1.9;  // of the cameras from the middle of a cube of 2 m: a to 50 degrees
constexpr double kReading = 0.05;  // [px]
constexpr double kSurvey = 2e-4;   // [m]

struct WideStudy {
  std::vector<data::RigCamera> truth;
  Observations data;

  bool Read(std::size_t camera, const Eigen::Vector3d& p, double* u) const {
    const Eigen::Vector3d p_C = truth[camera].R_CW * (p - truth[camera].p_WC);
    if (p_C.z() <= 0.0) return false;
    const double angle = std::atan2(p_C.x(), p_C.z());
    *u = truth[camera].u0_px + 2.0 * truth[camera].f_px * std::sin(0.5 * angle);
    return *u >= 0.0 && *u <= kPixels - 1;
  }
};

WideStudy MakeWide(std::uint64_t seed, int points) {
  const Rng rng(seed);
  WideStudy study;
  testing::RigOptions options;
  options.distance = kDistance;
  options.distortion = 0.0;
  study.truth = testing::MakeRig(options, rng.Stream("rig"));
  for (data::RigCamera& camera : study.truth) camera.f_px *= 1150.0 / options.f_px;
  Rng noise = rng.Stream("noise");
  study.data.p = testing::PointsInCube(points, 0.95, rng.Stream("points"));
  for (const auto& camera : study.truth) {
    study.data.cameras.push_back(camera.name);
    study.data.pixels.push_back(kPixels);
  }
  for (Eigen::Index i = 0; i < study.data.p.cols(); ++i) {
    study.data.ids.push_back("p" + std::to_string(i + 1));
    study.data.cov.emplace_back(kSurvey * kSurvey * Eigen::Matrix3d::Identity());
    for (std::size_t j = 0; j < study.truth.size(); ++j) {
      double u = 0.0;
      if (!study.Read(j, study.data.p.col(i), &u)) continue;
      study.data.readings.push_back(
          {static_cast<int>(i), static_cast<int>(j), u + kReading * noise.Normal(), kReading});
    }
    for (int k = 0; k < 3; ++k) study.data.p(k, i) += kSurvey * noise.Normal();
  }
  return study;
}

CalibrateOptions With(data::LensModel lens) {
  CalibrateOptions options;
  options.guess.lens = lens;
  return options;
}

// Squared errors of points found with the calibrated rig from noise-free readings of the true
// cameras, in units of what the rig's covariance says.
TEST(FisheyeCalibration, ErrorsOfPointsAreThosePredicted) {
  constexpr int kSeeds = 4;
  double nees = 0.0, n = 0.0, squares = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const WideStudy study = MakeWide(static_cast<std::uint64_t>(seed), 150);
    const Calibration result = Calibrate(study.data, With(data::LensModel::kFisheye), "test");
    EXPECT_EQ(result.rig.verdict, kGood) << seed << ": " << result.rig.reasons[0];
    EXPECT_EQ(result.report.lens_model, "two-parameter") << seed;
    const measure::Triangulator triangulator(result.rig, {.residual_level = 1e-12});
    Eigen::Matrix3Xd F(3, triangulator.shared_rank());
    const Eigen::Matrix3Xd places =
        testing::PointsInCube(40, 0.8, Rng(static_cast<std::uint64_t>(100 + seed)));
    for (Eigen::Index i = 0; i < places.cols(); ++i) {
      std::vector<double> u(study.truth.size()), s(study.truth.size(), kReading);
      bool all = true;
      for (std::size_t j = 0; j < u.size(); ++j) all = study.Read(j, places.col(i), &u[j]) && all;
      if (!all) continue;
      const auto found = triangulator.Solve(u, s, places.col(i));
      ASSERT_EQ(found.outcome, measure::PointOutcome::kSolved);
      triangulator.SharedFactor(found, s, F);
      const Eigen::Vector3d error = found.p - places.col(i);
      nees += error.dot((F * F.transpose()).llt().solve(error));
      squares += error.squaredNorm();
      n += 1.0;
    }
  }
  ASSERT_GT(n, 100.0);
  // The points of one rig share its error, of some 30 parameters that matter: over four
  // rigs the mean of a chi-square with about 100 degrees of freedom, to five sigmas (0.14 each).
  EXPECT_NEAR(nees / (3.0 * n), 1.0, 0.7);
  EXPECT_LT(std::sqrt(squares / n), 3e-4);  // of the order of the survey's own error
}

TEST(FisheyeCalibration, APinholesTermsDoNotFollowTheLens) {
  const WideStudy study = MakeWide(1, 150);
  const Calibration wide = Calibrate(study.data, With(data::LensModel::kFisheye), "test");
  Calibration straight;
  try {
    CalibrateOptions ten = With(data::LensModel::kRectilinear);
    ten.order = kFullOrder;
    straight = Calibrate(study.data, ten, "test");
  } catch (const Error& error) {
    return;  // no camera explains the readings: as good
  }
  // Ten terms in x leave a tenth of a pixel at 50 degrees; two in the angle leave nothing.
  EXPECT_GT(straight.rig.model_floor_px, kReading);
  EXPECT_LT(wide.rig.model_floor_px, 0.3 * kReading);
}

}  // namespace
}  // namespace unfurl::calib::lens_model_test
