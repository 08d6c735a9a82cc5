#include "measure/camera_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/pose.h"
#include "base/random.h"

namespace unfurl::measure::camera_model_test {
namespace {

using CameraVector = Eigen::Matrix<double, data::kCameraParameters, 1>;

data::RigCamera RandomCamera(Rng* rng) {
  data::RigCamera camera;
  camera.R_CW = RotationFromVector({rng->Uniform(-2, 2), rng->Uniform(-2, 2), rng->Uniform(-2, 2)});
  camera.p_WC = {rng->Normal(), rng->Normal(), rng->Normal()};
  camera.f_px = rng->Uniform(1500.0, 3000.0);
  camera.u0_px = rng->Uniform(1000.0, 1150.0);
  camera.e = rng->Uniform(0.01, 0.06);
  for (double& term : camera.terms_px) term = 300.0 * rng->Normal();
  return camera;
}

Eigen::Vector3d RandomPointBefore(const data::RigCamera& camera, Rng* rng) {
  const double Z = rng->Uniform(1.5, 5.0);
  const Eigen::Vector3d p_C(Z * rng->Uniform(-0.4, 0.4), Z * rng->Uniform(-0.5, 0.5), Z);
  return camera.p_WC + camera.R_CW.transpose() * p_C;
}

TEST(CameraModel, AgreesWithTheFormulaWrittenOut) {
  data::RigCamera camera;
  camera.f_px = 2200.0;
  camera.u0_px = 1079.5;
  camera.e = 0.04;
  for (std::size_t k = 0; k < 10; ++k) camera.terms_px[k] = 100.0 + 7.0 * static_cast<double>(k);
  const Eigen::Vector3d p(0.7, -0.9, 2.8);
  const double x = 0.7 / 2.8, y = -0.9 / 2.84;
  const double powers[10] = {
      std::pow(x, 3), x * y * y, std::pow(x, 5), std::pow(x, 3) * y * y, x * std::pow(y, 4), x * x,
      x * y,          y * y,     x * x * y,      std::pow(y, 3)};
  double expected = 1079.5 + 2200.0 * x;
  for (std::size_t k = 0; k < 10; ++k) expected += camera.terms_px[k] * powers[k];
  double u = 0.0;
  ASSERT_TRUE(Project(camera, p, &u));
  EXPECT_NEAR(u, expected, 1e-10);  // round-off of a number near 1600
}

TEST(CameraModel, BothFormsAgree) {
  Rng rng(3);
  for (int trial = 0; trial < 50; ++trial) {
    const data::RigCamera camera = RandomCamera(&rng);
    const Eigen::Vector3d p = RandomPointBefore(camera, &rng);
    double u = 0.0;
    Projection full;
    ASSERT_TRUE(Project(camera, p, &u));
    ASSERT_TRUE(Project(camera, p, &full));
    EXPECT_NEAR(u, full.u_px, 1e-9);  // same sums in another order
  }
}

// Central differences of step h err by h^2 u'''/6 and by 1e-13 / h in round-off: at these steps
// both stay below 1e-6 of a derivative's scale.
constexpr double kDifferenceTolerance = 2e-6;

TEST(CameraModel, DerivativeByThePoint) {
  Rng rng(4);
  const double h = 1e-5;
  for (int trial = 0; trial < 50; ++trial) {
    const data::RigCamera camera = RandomCamera(&rng);
    const Eigen::Vector3d p = RandomPointBefore(camera, &rng);
    Projection full;
    ASSERT_TRUE(Project(camera, p, &full));
    for (int k = 0; k < 3; ++k) {
      double plus = 0.0, minus = 0.0;
      ASSERT_TRUE(Project(camera, p + h * Eigen::Vector3d::Unit(k), &plus));
      ASSERT_TRUE(Project(camera, p - h * Eigen::Vector3d::Unit(k), &minus));
      EXPECT_NEAR((plus - minus) / (2.0 * h), full.du_dp(k), kDifferenceTolerance * 2000.0);
    }
  }
}

TEST(CameraModel, DerivativeByEveryParameter) {
  Rng rng(5);
  for (int trial = 0; trial < 50; ++trial) {
    const data::RigCamera camera = RandomCamera(&rng);
    const Eigen::Vector3d p = RandomPointBefore(camera, &rng);
    Projection full;
    ASSERT_TRUE(Project(camera, p, &full));
    for (int k = 0; k < data::kCameraParameters; ++k) {
      const double h = k < 6 ? 1e-5 : (k == 8 ? 1e-4 : 1.0);
      const double scale = k < 6 ? 2000.0 : (k == 8 ? 100.0 : 1.0);
      const CameraVector step = h * CameraVector::Unit(k);
      double plus = 0.0, minus = 0.0;
      ASSERT_TRUE(Project(Perturbed(camera, step), p, &plus));
      ASSERT_TRUE(Project(Perturbed(camera, -step), p, &minus));
      EXPECT_NEAR((plus - minus) / (2.0 * h), full.du_dc(k), kDifferenceTolerance * scale)
          << "parameter " << k;
    }
  }
}

TEST(CameraModel, RefusesWhatIsBehindTheSlit) {
  data::RigCamera camera;
  camera.f_px = 2000.0;
  double u = -1.0;
  Projection full;
  full.u_px = -1.0;
  EXPECT_FALSE(Project(camera, {0.0, 0.0, 0.0}, &u));
  EXPECT_FALSE(Project(camera, {1.0, 0.0, 0.04}, &u));  // 88 degrees off
  EXPECT_FALSE(Project(camera, {0.0, -1.0, 0.04}, &u));
  EXPECT_FALSE(Project(camera, {0.1, 0.0, -2.0}, &u));
  EXPECT_FALSE(Project(camera, {0.1, 0.0, -2.0}, &full));
  EXPECT_EQ(u, -1.0);
  EXPECT_EQ(full.u_px, -1.0);
  // However near.
  EXPECT_TRUE(Project(camera, {0.0, 0.0, 1e-6}, &u));
}

// A pinhole (e = 0, no terms) sees along its lens axis nothing: moving along it changes no reading.
TEST(CameraModel, PinholeIsBlindAlongItsLensAxis) {
  Rng rng(6);
  data::RigCamera camera = RandomCamera(&rng);
  camera.terms_px.fill(0.0);
  camera.e = 0.0;
  const Eigen::Vector3d p = RandomPointBefore(camera, &rng);
  double before = 0.0, after = 0.0;
  ASSERT_TRUE(Project(camera, p, &before));
  camera.p_WC += 0.5 * camera.R_CW.row(1).transpose();
  ASSERT_TRUE(Project(camera, p, &after));
  EXPECT_NEAR(before, after, 1e-9);
}

}  // namespace
}  // namespace unfurl::measure::camera_model_test
