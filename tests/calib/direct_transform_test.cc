#include "calib/direct_transform.h"

#include <gtest/gtest.h>

#include "calib/initial_guess.h"
#include "tests/calib/synthetic.h"

namespace unfurl::calib::direct_transform_test {
namespace {

using testing::MakeRig;
using testing::PointsInCube;

// A pinhole in a random pose, and what it reads of points in a cube.
struct Pinhole {
  data::RigCamera camera;
  Eigen::Matrix3Xd p;
  Eigen::VectorXd u;
};

Pinhole MakePinhole(int n, std::uint64_t seed) {
  const Rng rng(seed);
  Pinhole out;
  out.camera = MakeRig({.f_spread = 0.3, .pose_error = 0.1, .distortion = 0.0}, rng)[seed % 4];
  out.p = PointsInCube(n, 1.0, rng.Stream("points"));
  out.u.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) measure::Project(out.camera, out.p.col(i), &out.u(i));
  return out;
}

// Noise-free numbers of size 1000 px: round-off over the system's condition.
constexpr double kExactPx = 1e-7;
constexpr double kExactMetres = 1e-9;

TEST(DirectTransform, ExactOnNoiseFreePinholes) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Pinhole truth = MakePinhole(seed % 2 == 0 ? kDirectTransformPoints : 40, seed);
    const DirectFit fit = FitDirect(truth.p, truth.u);
    EXPECT_LT(DirectResiduals(fit.transform, truth.p, truth.u).cwiseAbs().maxCoeff(), kExactPx);
  }
}

TEST(DirectTransform, DecomposesIntoTheCameraItself) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Pinhole truth = MakePinhole(40, seed);
    const Eigen::Vector3d centre = truth.p.rowwise().mean();
    const data::RigCamera found = CameraFromDirect(FitDirect(truth.p, truth.u).transform, centre);
    EXPECT_LT((found.R_CW - truth.camera.R_CW).norm(), kExactMetres);
    EXPECT_NEAR(found.f_px, truth.camera.f_px, 100.0 * kExactPx);
    EXPECT_NEAR(found.u0_px, truth.camera.u0_px, 100.0 * kExactPx);
    // The slit's line is found; where on it, is the convention.
    const Eigen::Vector3d shift = found.R_CW * (found.p_WC - truth.camera.p_WC);
    EXPECT_NEAR(shift.x(), 0.0, 10.0 * kExactMetres);
    EXPECT_NEAR(shift.z(), 0.0, 10.0 * kExactMetres);
    EXPECT_NEAR((found.R_CW * (centre - found.p_WC)).y(), 0.0, 10.0 * kExactMetres);
  }
}

// A sensor mounted the other way round is the camera turned by half a turn about its optical axis.
TEST(DirectTransform, MirroredReadingsGiveATurnedCamera) {
  Pinhole truth = MakePinhole(40, 7);
  truth.u = (testing::kPixels - 1.0) - truth.u.array();
  const data::RigCamera found =
      CameraFromDirect(FitDirect(truth.p, truth.u).transform, truth.p.rowwise().mean());
  EXPECT_NEAR(found.R_CW.determinant(), 1.0, 1e-12);
  EXPECT_GT(found.f_px, 0.0);
  EXPECT_LT((found.R_CW.row(0) + truth.camera.R_CW.row(0)).norm(), kExactMetres);
  EXPECT_LT((found.R_CW.row(1) + truth.camera.R_CW.row(1)).norm(), kExactMetres);
  EXPECT_LT((found.R_CW.row(2) - truth.camera.R_CW.row(2)).norm(), kExactMetres);
}

TEST(DirectTransform, ConditionTellsDegenerateLayouts) {
  Pinhole truth = MakePinhole(60, 3);
  const double sound = FitDirect(truth.p, truth.u).condition;
  truth.p.row(2).setConstant(0.1);
  for (Eigen::Index i = 0; i < truth.p.cols(); ++i) {
    measure::Project(truth.camera, truth.p.col(i), &truth.u(i));
  }
  EXPECT_GT(sound, 1e-2);
  EXPECT_LT(FitDirect(truth.p, truth.u).condition, 1e-7);
}

TEST(DirectTransform, RobustFitStandsAFifthOfGrossErrors) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Pinhole truth = MakePinhole(100, seed);
    Rng rng = Rng(seed).Stream("gross");
    for (Eigen::Index i = 0; i < truth.u.size(); ++i) truth.u(i) += 0.1 * rng.Normal();
    const Eigen::VectorXd clean = truth.u;
    for (Eigen::Index i = 0; i < 20; ++i) truth.u(i) = rng.Uniform(0.0, testing::kPixels - 1.0);
    const RobustDirectFit fit = FitDirectRobust(truth.p, truth.u, Rng(seed));
    const Eigen::VectorXd left = DirectResiduals(fit.fit.transform, truth.p, clean);
    // 0.1 px of noise over 80 readings and 7 unknowns leaves 0.03 px of error on average; at a
    // corner of the cube several times that.
    EXPECT_LT(left.cwiseAbs().maxCoeff(), 0.6) << "seed " << seed;
    // The median of all residuals is the 62.5% point of the good ones': 1.31 sigmas on average.
    EXPECT_GT(fit.sigma_px, 0.09);
    EXPECT_LT(fit.sigma_px, 0.19);
  }
}

}  // namespace
}  // namespace unfurl::calib::direct_transform_test
