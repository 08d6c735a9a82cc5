#include "measure/camera_bank.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/measure/fixtures.h"

namespace unfurl::measure::camera_bank_test {
namespace {

TEST(CameraBank, IsTheCameraModelForAllCamerasAtOnce) {
  constexpr double kRoundOff = 1e-12;  // relative
  data::Rig rig = ShippedRig();
  Rng rng(3);
  for (data::RigCamera& camera : rig.cameras) {
    for (double& term : camera.terms_px) term += rng.Uniform(-30.0, 30.0);
  }
  const CameraBank bank(rig.cameras);
  const Eigen::Matrix3Xd points = RandomPoints(rig.volume_low, rig.volume_high, 50, 5);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d p = points.col(i);
    std::vector<double> u(bank.lanes(), 0.0), w(bank.lanes(), 0.0), seen(bank.lanes());
    Eigen::Matrix3d JwJ = Eigen::Matrix3d::Zero();
    Eigen::Vector3d Jwr = Eigen::Vector3d::Zero();
    double chi_square = 0.0;
    bank.Readings(p.data(), seen.data());
    for (std::size_t c = 0; c < 4; ++c) {
      Projection here;
      ASSERT_TRUE(Project(rig.cameras[c], p, &here));
      EXPECT_NEAR(seen[c], here.u_px, kRoundOff * 2000.0);
      u[c] = here.u_px + rng.Uniform(-5.0, 5.0);
      w[c] = c == 2 ? 0.0 : rng.Uniform(1.0, 2000.0);
      JwJ += w[c] * here.du_dp.transpose() * here.du_dp;
      Jwr += w[c] * (u[c] - here.u_px) * here.du_dp.transpose();
      chi_square += w[c] * (u[c] - here.u_px) * (u[c] - here.u_px);
    }
    CameraBank::Sums sums;
    bank.Accumulate(p.data(), u.data(), w.data(), &sums);
    const double scale = JwJ.trace();
    EXPECT_NEAR(sums.JwJ[0], JwJ(0, 0), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[1], JwJ(0, 1), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[2], JwJ(0, 2), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[3], JwJ(1, 1), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[4], JwJ(1, 2), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[5], JwJ(2, 2), kRoundOff * scale);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(sums.Jwr[k], Jwr(k), kRoundOff * 10.0 * scale);
    EXPECT_NEAR(sums.chi_square, chi_square, 1e-9 * chi_square);
    EXPECT_TRUE(sums.in_front);
  }
  CameraBank::Sums sums;
  const std::vector<double> u(bank.lanes(), 0.0);
  std::vector<double> w(bank.lanes(), 1.0);
  const Eigen::Vector3d behind = rig.cameras[1].p_WC + Eigen::Vector3d(0.0, 0.0, 1.0);
  bank.Accumulate(behind.data(), u.data(), w.data(), &sums);
  EXPECT_FALSE(sums.in_front);
}

}  // namespace
}  // namespace unfurl::measure::camera_bank_test
