#include "measure/ray.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/pose.h"

namespace unfurl::measure::ray_test {
namespace {

constexpr double kRoundOff = 1e-14;
constexpr double kGlass = 1.5149;

TEST(Refract, FollowsSnellsLawInThePlaneOfIncidence) {
  // A skew direction and a skew normal.
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
  const Eigen::Vector3d d = Eigen::Vector3d(-0.2, 0.7, 0.4).normalized();
  Eigen::Vector3d out;
  ASSERT_TRUE(Refract(d, normal, 1.0, kGlass, &out));
  EXPECT_NEAR(out.norm(), 1.0, kRoundOff);
  EXPECT_NEAR(d.cross(normal).norm(), kGlass * out.cross(normal).norm(), kRoundOff);
  EXPECT_NEAR(out.dot(d.cross(normal)), 0.0, kRoundOff);
  EXPECT_GT(d.dot(normal) * out.dot(normal), 0.0);
  // Either side of the normal, and back the same way.
  Eigen::Vector3d other, back;
  ASSERT_TRUE(Refract(d, -normal, 1.0, kGlass, &other));
  EXPECT_NEAR((other - out).norm(), 0.0, kRoundOff);
  ASSERT_TRUE(Refract(-out, normal, kGlass, 1.0, &back));
  EXPECT_NEAR((back + d).norm(), 0.0, kRoundOff);
}

TEST(Refract, PrismAtLeastDeviation) {
  // n = sin((A + D) / 2) / sin(A / 2) at the symmetric passage; find D from two refractions.
  const double apex = std::numbers::pi / 3.0;
  const double deviation = 2.0 * std::asin(kGlass * std::sin(apex / 2.0)) - apex;
  const Eigen::Vector3d first(-std::cos(apex / 2.0), std::sin(apex / 2.0), 0.0);
  const Eigen::Vector3d second(std::cos(apex / 2.0), std::sin(apex / 2.0), 0.0);
  const Eigen::Vector3d d(std::cos(deviation / 2.0), std::sin(deviation / 2.0), 0.0);
  Eigen::Vector3d inside, out;
  ASSERT_TRUE(Refract(d, first, 1.0, kGlass, &inside));
  EXPECT_NEAR(inside.y(), 0.0, kRoundOff);
  ASSERT_TRUE(Refract(inside, second, kGlass, 1.0, &out));
  EXPECT_NEAR(std::acos(d.dot(out)), deviation, 1e-12);  // acos loses half the digits of nothing
}

TEST(Refract, ReflectsTotallyBeyondTheCriticalAngle) {
  const double critical = std::asin(1.0 / kGlass);
  Eigen::Vector3d out;
  const auto at = [&](double angle) {
    return Refract({std::sin(angle), 0.0, std::cos(angle)}, Eigen::Vector3d::UnitZ(), kGlass, 1.0,
                   &out);
  };
  EXPECT_TRUE(at(critical - 1e-6));
  EXPECT_FALSE(at(critical + 1e-6));
}

TEST(Transmission, NormalIncidenceBrewsterAndReciprocity) {
  const double r = (kGlass - 1.0) / (kGlass + 1.0);
  EXPECT_NEAR(Transmission(1.0, 1.0, 1.0, kGlass), 1.0 - r * r, kRoundOff);
  // At Brewster's angle p is not reflected and s is by ((n^2 - 1) / (n^2 + 1))^2.
  const double brewster = std::atan(kGlass);
  const double inside = std::asin(std::sin(brewster) / kGlass);
  const double s = (kGlass * kGlass - 1.0) / (kGlass * kGlass + 1.0);
  EXPECT_NEAR(Transmission(std::cos(brewster), std::cos(inside), 1.0, kGlass), 1.0 - 0.5 * s * s,
              kRoundOff);
  EXPECT_NEAR(Transmission(std::cos(brewster), std::cos(inside), 1.0, kGlass),
              Transmission(std::cos(inside), std::cos(brewster), kGlass, 1.0), kRoundOff);
}

TEST(Surface, HitLiesOnItAndTheNormalIsItsGradient) {
  const Surface cylinder{.x0 = 0.001, .z0 = -0.011, .curvature = 1.0 / 0.016};
  const Ray ray{{0.003, 0.002, 0.0}, Eigen::Vector3d(0.1, 0.2, -0.97).normalized()};
  Eigen::Vector3d hit, normal;
  ASSERT_TRUE(cylinder.Intersect(ray, &hit, &normal));
  const double radius = std::hypot(hit.x() - 0.001, hit.z() - (-0.011 + 0.016));
  EXPECT_NEAR(radius, 0.016, 1e-16);
  EXPECT_LT(hit.z(), -0.008);  // the near side of the cylinder, at its vertex
  EXPECT_NEAR(normal.norm(), 1.0, kRoundOff);
  EXPECT_NEAR((hit - ray.origin).cross(ray.direction).norm(), 0.0, 1e-16);
}

TEST(Surface, PlaneIsTheLimitOfWeakCurvature) {
  const Ray ray{{0.001, 0.002, 0.0}, Eigen::Vector3d(0.3, -0.2, -0.9).normalized()};
  Eigen::Vector3d flat, bent, normal;
  ASSERT_TRUE((Surface{.z0 = -0.005}.Intersect(ray, &flat, &normal)));
  EXPECT_NEAR(flat.z(), -0.005, 1e-17);
  ASSERT_TRUE((Surface{.z0 = -0.005, .curvature = 1e-9}.Intersect(ray, &bent, &normal)));
  EXPECT_NEAR((bent - flat).norm(), 0.0, 1e-13);  // sag: c x^2 / 2
}

TEST(Surface, RayBesideTheCylinderMisses) {
  const Surface cylinder{.curvature = 1.0 / 0.016};
  Eigen::Vector3d hit, normal;
  EXPECT_FALSE(cylinder.Intersect({{0.020, 0.0, 0.1}, {0.0, 0.0, -1.0}}, &hit, &normal));
}

}  // namespace
}  // namespace unfurl::measure::ray_test
