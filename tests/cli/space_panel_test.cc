// A rig as a view in space shows it.
#include "cli/space_panel.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/error.h"

namespace unfurl::cli::space_panel_test {
namespace {

Eigen::Vector3d Vector(const report::Place& at) { return {at[0], at[1], at[2]}; }

// Two metres above the middle of its volume, turned about its axis and tilted; no distortion, so
// that a reading is u0 + f X / Z.
data::Rig OneCamera() {
  data::Rig rig;
  data::RigCamera camera;
  camera.name = "top";
  camera.pixels = 2000;
  camera.f_px = 1500.0;
  camera.u0_px = 900.0;
  camera.p_WC = {0.1, -0.2, 2.0};
  camera.R_CW = (Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()) *
                 Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
                 Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()))
                    .toRotationMatrix();
  rig.cameras = {camera};
  rig.volume_low = {-0.5, -0.4, -0.3};
  rig.volume_high = {0.5, 0.4, 0.3};
  return rig;
}

TEST(SpacePanel, AFieldEndsAtTheFirstAndTheLastPixel) {
  const data::Rig rig = OneCamera();
  const report::Space space = SpaceOf(rig, "t", "n");
  ASSERT_EQ(space.eyes[0].field.size(), 4U);
  const double slopes[4] = {-900.0 / 1500.0, 1099.0 / 1500.0, 1099.0 / 1500.0, -900.0 / 1500.0};
  double least = HUGE_VAL, most = -HUGE_VAL, across_low = HUGE_VAL, across_high = -HUGE_VAL;
  const auto seen = [&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
    return rig.cameras[0].R_CW * (p - rig.cameras[0].p_WC);
  };
  const double depth = seen(Eigen::Vector3d::Zero()).z();  // the volume's middle
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d q = seen(Vector(space.eyes[0].field[k]));
    EXPECT_NEAR(q.x() / q.z(), slopes[k], 1e-6) << k;
    EXPECT_NEAR(q.z(), depth, 1e-9);
    least = std::min(least, q.y());
    most = std::max(most, q.y());
  }
  // Across the row as far as the box reaches.
  for (unsigned k = 0; k < 8; ++k) {
    const Eigen::Vector3d q = seen({(k & 1U) != 0 ? space.high[0] : space.low[0],
                                    (k & 2U) != 0 ? space.high[1] : space.low[1],
                                    (k & 4U) != 0 ? space.high[2] : space.low[2]});
    across_low = std::min(across_low, q.y());
    across_high = std::max(across_high, q.y());
  }
  EXPECT_NEAR(least, across_low, 1e-9);
  EXPECT_NEAR(most, across_high, 1e-9);
  // The sheet of a reading holds the lens axis: no point of it changes the reading.
  EXPECT_NEAR((rig.cameras[0].R_CW * Vector(space.eyes[0].across)).x(), 0.0, 1e-12);
  EXPECT_NEAR((rig.cameras[0].R_CW * Vector(space.eyes[0].across)).z(), 0.0, 1e-12);
}

TEST(SpacePanel, ACameraThatLooksAwayHasNoField) {
  data::Rig rig = OneCamera();
  rig.cameras[0].R_CW = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(SpaceOf(rig, "t", "n").eyes[0].field.empty());
}

TEST(SpacePanel, AFlatOrMissingVolumeStillHasABox) {
  data::Rig rig = OneCamera();
  rig.volume_high.z() = rig.volume_low.z();
  EXPECT_NO_THROW(report::SpaceHtml(SpaceOf(rig, "t", "n"), "s"));
  rig.volume_low = rig.volume_high = Eigen::Vector3d::Zero();
  EXPECT_NO_THROW(report::SpaceHtml(SpaceOf(rig, "t", "n"), "s"));
}

TEST(SpacePanel, SemiAxesMakeUpTheCovariance) {
  Eigen::Matrix3d root;
  root << 3e-4, 0.0, 0.0, 1e-4, 2e-4, 0.0, -2e-4, 1e-4, 1e-4;
  const Eigen::Matrix3d covariance = root * root.transpose();
  const report::SpaceEllipsoid one = EllipsoidOf(Eigen::Vector3d::Zero(), covariance, 1.0);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const report::Place& axis : one.axes) sum += Vector(axis) * Vector(axis).transpose();
  EXPECT_LT((sum - covariance).norm(), 1e-12 * covariance.norm());
  EXPECT_NEAR(Vector(one.axes[0]).dot(Vector(one.axes[1])), 0.0, 1e-12 * covariance.norm());
}

TEST(SpacePanel, PointsAreColouredByTheirReadings) {
  ReadingsCloud readings(3);
  readings.Add(0, 0, 0.3, 0.1, false);    // 3 sigmas
  readings.Add(0, 1, -0.2, 0.05, false);  // 4: RMS sqrt(12.5)
  readings.Add(0, 2, 9.0, 0.1, true);     // left out: seen, but no part of it
  readings.Add(1, 2, 0.1, 0.0, false);    // nothing to judge it by
  const report::SpaceCloud cloud =
      readings.Cloud({"a", "b", "c"}, Eigen::Matrix3Xd::Zero(3, 3), {"residual", "1"});
  EXPECT_NEAR(cloud.points[0].value, std::sqrt(12.5), 1e-12);
  EXPECT_EQ(cloud.points[0].seen, 3U);
  EXPECT_EQ(cloud.points[0].refused, 4U);
  EXPECT_TRUE(std::isnan(cloud.points[1].value));
  EXPECT_TRUE(std::isnan(cloud.points[2].value));
}

TEST(SpacePanel, OfTooManyPointsTheWorstStayInTheirOrder) {
  report::SpaceCloud cloud;
  const std::size_t count = report::kMostSpacePoints + 100;
  for (std::size_t k = 0; k < count; ++k) {
    // Fewer than a hundred have no value, and as many are small.
    const double value = k % 50 == 0 ? std::nan("") : k % 50 == 1 ? 0.0 : 1.0;
    cloud.points.push_back({{0.0, 0.0, 0.0}, value, std::to_string(k)});
  }
  KeepWorst(&cloud);
  ASSERT_EQ(cloud.points.size(), report::kMostSpacePoints);
  int before = -1;
  for (const report::SpacePoint& point : cloud.points) {
    EXPECT_LT(before, std::stoi(point.label));
    before = std::stoi(point.label);
    EXPECT_FALSE(std::isnan(point.value));
  }
}

}  // namespace
}  // namespace unfurl::cli::space_panel_test
