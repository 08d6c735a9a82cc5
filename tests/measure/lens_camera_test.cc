#include "measure/lens_camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::lens_camera_test {
namespace {

constexpr double kIndex = 1.5149;
constexpr double kRadius = 0.016;
constexpr double kThickness = 0.006;
constexpr double kStop = 0.005;

// Perfectly mounted; `slit` across. c1 and c2: curvatures as in Surface.
LensCamera MakeCamera(double slit, double index, double c1, double c2, double sensor_distance) {
  LensCamera camera;
  camera.slit_half_width = 0.5 * slit;
  camera.slit_half_length = 0.05;
  camera.glass.index = index;
  camera.glass.half_width = 0.006;
  camera.glass.half_length = 0.05;
  camera.glass.faces[0] = {.z0 = -kStop, .curvature = c1};
  camera.glass.faces[1] = {.z0 = -kStop - kThickness, .curvature = c2};
  camera.sensor.centre = {0.0, 0.0, -sensor_distance};
  camera.sensor.row = -Eigen::Vector3d::UnitX();
  camera.sensor.column = Eigen::Vector3d::UnitY();
  camera.sensor.pitch = 14e-6;
  camera.sensor.pixels = 2160;
  camera.sensor.blur = 12e-6;
  return camera;
}

// Gaussian optics of a thick lens, light through face 1 then 2, by the lensmaker's equation: image
// distance from the last vertex of a point `object` in front of the first.
double GaussianImage(double index, double r1, double r2, double thickness, double object) {
  const double power =
      (index - 1.0) * (1.0 / r1 - 1.0 / r2 + (index - 1.0) * thickness / (index * r1 * r2));
  const double f = 1.0 / power;
  const double h1 = -f * (index - 1.0) * thickness / (index * r2);  // first principal plane
  const double h2 = -f * (index - 1.0) * thickness / (index * r1);  // second, from the last vertex
  const double s = object + h1;
  return 1.0 / (1.0 / f - 1.0 / s) + h2;
}

TEST(LensCamera, FocusFollowsTheLensmakerForEveryShapeAndDistance) {
  // With a slit of 20 um aberrations vanish: what is left is of the order (slit / radius)^2.
  constexpr double kRelative = 1e-6;
  constexpr double kFlat = 1e12;
  for (const double distance : {0.5, 1.6, 3.2, 50.0}) {
    const double object = distance + kStop;
    const struct {
      double c1, c2, r1, r2;
    } shapes[] = {{0.0, 1.0 / kRadius, kFlat, -kRadius},
                  {-1.0 / kRadius, 0.0, kRadius, kFlat},
                  {-1.0 / kRadius, 1.0 / kRadius, kRadius, -kRadius}};
    for (const auto& shape : shapes) {
      const LensCamera camera = MakeCamera(20e-6, kIndex, shape.c1, shape.c2, 0.04);
      const double expected =
          kStop + kThickness + GaussianImage(kIndex, shape.r1, shape.r2, kThickness, object);
      EXPECT_NEAR(FocusedSensorDistance(camera, distance) / expected, 1.0, kRelative);
    }
  }
}

TEST(LensCamera, FocalLengthOfThePlanoConvex) {
  // R / (n - 1): the image of a far point lies that far behind the curved back vertex.
  const LensCamera camera = MakeCamera(20e-6, kIndex, 0.0, 1.0 / kRadius, 0.04);
  EXPECT_NEAR(FocusedSensorDistance(camera, 1e7) - kStop - kThickness, kRadius / (kIndex - 1.0),
              1e-7);
}

TEST(LensCamera, PlanePlateShiftsARayByTheClosedForm) {
  const double depth = 0.042;
  const LensCamera plate = MakeCamera(0.8e-3, kIndex, 0.0, 0.0, depth);
  const double angle = 0.4;
  Landing landing;
  ASSERT_TRUE(TraceThroughSlit(plate, {3.0 * std::tan(angle), 0.0, 3.0}, 0.0, 0.0, &landing));
  const double inside = std::asin(std::sin(angle) / kIndex);
  const double x = -((depth - kThickness) * std::tan(angle) + kThickness * std::tan(inside));
  EXPECT_NEAR(landing.u, 0.5 * 2159 - x / 14e-6, 1e-9);
  EXPECT_NEAR(landing.across, 0.0, 1e-15);
}

TEST(LensCamera, FluxIsTheSolidAngleOfTheSlitThatTheRowSees) {
  // Glass of index 1 is air: the row's height, seen through the slit, is a rectangle there.
  const double Z = 3.0, depth = 0.042, slit = 0.8e-3;
  const LensCamera air = MakeCamera(slit, 1.0, 0.0, 0.0, depth);
  SpotLight spot;
  ASSERT_TRUE(TraceSpot(air, {0.0, 0.0, Z}, &spot));
  const double height = 14e-6 * Z / (Z + depth);
  EXPECT_NEAR(spot.flux / (slit * height / (Z * Z)), 1.0, 1e-6);  // (slit / Z)^2 is left out
  // A point off the axis: cos^3 of the obliquity, and the same height.
  const double X = 1.0, Y = -0.7;
  ASSERT_TRUE(TraceSpot(air, {X, Y, Z}, &spot));
  const double at_slit = Y * depth / (Z + depth);  // where its light crosses the slit
  const double r = std::sqrt(X * X + (Y - at_slit) * (Y - at_slit) + Z * Z);
  EXPECT_NEAR(spot.flux / (slit * height * Z / (r * r * r)), 1.0, 1e-6);
  // A shadow of the slit: its width on the row is slit (Z + depth) / Z, its centre -X depth / Z;
  // the side of the slit nearer to the point gets more light, by 3 X x / r^2.
  const double nearer = 3.0 * X * slit * slit / (12.0 * r * r) * (Z + depth) / Z;
  EXPECT_NEAR(spot.centre_px, 0.5 * 2159 + (X * depth / Z - nearer) / 14e-6,
              1e-5);  // to (slit / r)^2
  EXPECT_NEAR(spot.sigma_px, slit * (Z + depth) / Z / 14e-6 / std::sqrt(12.0), 1e-6);
}

TEST(LensCamera, SpotAgreesWithRaysThrownAtRandom) {
  // Second formulation: rays through random places of the slit; those that land within a tall row
  // are its light. Its centroid and spread, within four of their own standard errors.
  constexpr double kTallRow = 0.003;  // [px]
  const VirtualRig rig = MakeVirtualRig(ShippedLab());
  const LensCamera& camera = rig.cameras[1];
  Rng rng(3);
  for (const Eigen::Vector3d& p_W : {Eigen::Vector3d(0.1, 0.0, 0.0), Eigen::Vector3d(1.0, 0.9, 0.8),
                                     Eigen::Vector3d(-1, 1, -1)}) {
    SpotLight spot;
    ASSERT_TRUE(TraceSpot(camera, p_W, &spot));
    const Eigen::Vector3d p_C = camera.X_WC.inverse() * p_W;
    const double depth = -camera.sensor.centre.z();
    const double y_mid = p_C.y() * depth / (p_C.z() + depth);
    double sum = 0.0, first = 0.0, second = 0.0;
    int n = 0;
    for (int i = 0; i < 400000; ++i) {
      const double x = camera.slit_half_width * rng.Uniform(-1.0, 1.0);
      const double y = y_mid + 1.5e-3 * rng.Uniform(-1.0, 1.0);
      Landing landing;
      if (!TraceThroughSlit(camera, p_C, x, y, &landing)) continue;
      if (std::abs(landing.across) > 70e-6) continue;
      const Eigen::Vector3d sight = p_C - Eigen::Vector3d(x, y, 0.0);
      const double w = landing.transmission * sight.z() / std::pow(sight.norm(), 3);
      const double d = landing.u - spot.centre_px;
      sum += w;
      first += w * d;
      second += w * d * d;
      ++n;
    }
    ASSERT_GT(n, 10000);
    const double mean = first / sum;
    const double sigma = std::sqrt(second / sum - mean * mean);
    const double error = sigma / std::sqrt(static_cast<double>(n));
    EXPECT_NEAR(mean, 0.0, 4.0 * error);
    // Bundles spread light evenly between edges, and the row of the thrown rays is ten times
    // taller.
    EXPECT_NEAR(sigma, spot.sigma_px, 4.0 * error + 0.01 * spot.sigma_px + kTallRow);
  }
}

TEST(LensCamera, TheAxisAlongTheSlitHasItsCentreBehindTheSlit) {
  // Two centres: moving a point along the line to the slit's centre in x and to a point e behind it
  // in y leaves the reading; with e = 0 it would not.
  const VirtualRig rig = MakeVirtualRig(ShippedLab(
      {"mounting.position=0.0", "mounting.rotation=0.0", "mounting.sensor_shift=0.0",
       "mounting.sensor_roll=0.0", "mounting.sensor_tilt=0.0", "mounting.lens_decentre=0.0"}));
  const LensCamera& camera = rig.cameras[0];
  // Reduced distance of the row behind the slit: glass counts 1/n.
  const double e = -camera.sensor.centre.z() - kThickness * (1.0 - 1.0 / kIndex);
  const auto read = [&](double x, double y, double Z, double centre) {
    SpotLight spot;
    EXPECT_TRUE(
        TraceSpot(camera, camera.X_WC * Eigen::Vector3d(x * Z, y * (Z + centre), Z), &spot));
    return spot.centre_px;
  };
  const double near = read(0.3, 0.3, 2.0, e), far = read(0.3, 0.3, 4.0, e);
  const double near0 = read(0.3, 0.3, 2.0, 0.0), far0 = read(0.3, 0.3, 4.0, 0.0);
  EXPECT_LT(std::abs(near - far), 0.2 * std::abs(near0 - far0));
}

TEST(LensCamera, LensAndSlitCutOffLight) {
  LensCamera camera = MakeCamera(0.8e-3, kIndex, 0.0, 1.0 / kRadius, 0.0424);
  SpotLight spot;
  EXPECT_FALSE(TraceSpot(camera, {0.0, 0.0, -1.0}, &spot));  // behind
  EXPECT_FALSE(TraceSpot(camera, {6.0, 0.0, 2.0}, &spot));   // beside the lens
  EXPECT_TRUE(TraceSpot(camera, {0.0, 1.5, 2.0}, &spot));
  camera.slit_half_length = 0.010;
  EXPECT_FALSE(TraceSpot(camera, {0.0, 1.5, 2.0}, &spot));  // above the slit's end
}

}  // namespace
}  // namespace unfurl::measure::lens_camera_test
