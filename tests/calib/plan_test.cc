// Surveys that are planned: what a station's data sheet makes of points, and whether a calibration
// by rays through glass then reaches what was foretold.
#include "calib/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/random_vector.h"
#include "base/worker_pool.h"
#include "calib/plan_survey.h"
#include "measure/triangulate.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::plan_test {
namespace {

using testing::TracedLab;

constexpr std::size_t kLabs = testing::Labs(2, 40);
constexpr int kPoints = 150;
constexpr double kReading = 0.03;  // [px]

#ifndef UNFURL_SLOW_TESTS

TEST(StationAccuracyWords, AreReadOrRefused) {
  const StationAccuracy one = ParseStationAccuracy("1mm+0.1mm/m, 0.1mrad", "--station");
  EXPECT_DOUBLE_EQ(one.offset, 1e-3);
  EXPECT_DOUBLE_EQ(one.scale, 1e-4);
  EXPECT_DOUBLE_EQ(one.angle, 1e-4);
  const StationAccuracy two = ParseStationAccuracy("1.5 mm + 2 ppm, 1 arcsec", "--station");
  EXPECT_DOUBLE_EQ(two.offset, 1.5e-3);
  EXPECT_DOUBLE_EQ(two.scale, 2e-6);
  EXPECT_NEAR(two.angle, 4.848e-6, 1e-9);
  EXPECT_NEAR(ParseStationAccuracy("0.3mm,0.3mgon", "--station").angle, 4.712e-6, 1e-9);
  for (const char* text :
       {"", "1mm", "1mm+2ppm", "1, 1arcsec", "1mm+2, 1arcsec", "1mm, 1", "1mm+2ppm+1ppm, 1arcsec",
        "-1mm, 1arcsec", "1mm, 1arcsec, 3", "0mm, 1arcsec", "nan mm, 1arcsec"}) {
    EXPECT_THROW(ParseStationAccuracy(text, "--station"), Error) << text;
  }
}

// Along the sight the distance's error, across it the angles', by scatter of measured points.
TEST(StationAccuracyWords, AreTheScatterOfPoints) {
  data::Survey survey;
  survey.id = {"a"};
  survey.station = Eigen::Vector3d(1.0, -2.0, 0.5);
  survey.p = Eigen::Vector3d(4.0, 2.0, 0.5);  // 5 m away, level
  survey.cov.setZero(6, 1);
  SetAccuracy({.offset = 1e-3, .scale = 2e-4, .angle = 3e-4}, "points", &survey);
  Rng rng(5);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  constexpr int kRepeats = 20000;
  const Eigen::Vector3d along(0.6, 0.8, 0.0), level(-0.8, 0.6, 0.0), up(0.0, 0.0, 1.0);
  for (int k = 0; k < kRepeats; ++k) {
    const Eigen::Vector3d e =
        2e-3 * rng.Normal() * along + 1.5e-3 * rng.Normal() * level + 1.5e-3 * rng.Normal() * up;
    scatter += e * e.transpose() / kRepeats;
  }
  const auto c = survey.cov.col(0);
  Eigen::Matrix3d stated;
  stated << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  // 1% is a variance's own error of 20,000 draws.
  EXPECT_LT((stated - scatter).norm(), 0.03 * stated.norm());
  survey.station.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THROW(SetAccuracy({1e-3, 0.0, 1e-4}, "points", &survey), Error);
}

#endif  // UNFURL_SLOW_TESTS

// Points as they are planned, as a station of 1 mm + 0.1 mm/m and 0.1 mrad would measure them.
data::Survey PlannedPoints(const TracedLab& lab) {
  data::Survey survey;
  survey.p = lab.Places(kPoints);
  survey.cov.setZero(6, kPoints);
  for (int i = 0; i < kPoints; ++i) survey.id.push_back("p" + std::to_string(i + 1));
  survey.station = Eigen::Vector3d(4.0, 1.0, 0.3);
  SetAccuracy(ParseStationAccuracy("1mm+0.1mm/m, 0.1mrad", "test"), "test", &survey);
  return survey;
}

// The survey that is then made of the laboratory as it was built, and calibrated.
data::Rig Reached(TracedLab lab, const data::Survey& planned) {
  lab.survey_sigma = 0.0;
  lab.reading_sigma = kReading;
  Observations data = lab.Survey(planned.p);
  Rng rng = lab.rng.Stream("station");
  for (Eigen::Index i = 0; i < planned.p.cols(); ++i) {
    const auto c = planned.cov.col(i);
    Eigen::Matrix3d& cov = data.cov[static_cast<std::size_t>(i)];
    cov << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
    const Eigen::Vector3d z = NormalVector(&rng);
    data.p.col(i) += cov.llt().matrixL() * z;
  }
  return Calibrate(data, {.workers = 1}, "test").rig;
}

// Squared errors of points in the middle of the plan's cells, and what was foretold of them [m^2].
struct Squares {
  double found = 0.0, foretold = 0.0;
};
Squares InCells(const TracedLab& lab, const data::Rig& rig, const UncertaintyMap& map) {
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Rng noise = lab.rng.Stream("found");
  const std::size_t cameras = rig.cameras.size();
  std::vector<double> u(cameras), s(cameras, kReading);
  Squares out;
  for (std::size_t cell = 0; cell < map.sigma.size(); ++cell) {
    if (map.cameras[cell] != static_cast<int>(cameras)) continue;
    bool all = true;
    for (std::size_t c = 0; c < cameras; ++c) {
      all = lab.Read(c, map.Middle(cell), &u[c]) && all;
      u[c] += kReading * noise.Normal();
    }
    const auto point = triangulator.Solve(u, s, map.Middle(cell));
    if (!all || point.outcome != measure::PointOutcome::kSolved) continue;
    out.found += (point.p - map.Middle(cell)).squaredNorm();
    out.foretold += map.sigma[cell] * map.sigma[cell];
  }
  return out;
}

// A calibration's error is some 24 numbers.
TEST(PlannedSurvey, IsReachedWithinTenPercent) {
  const data::Lab nominal = data::ReadLab(UNFURL_SOURCE_DIR "/data/sets/deployment/lab.toml");
  const TracedLab first(700);
  PlanOptions options;
  options.survey = PlannedPoints(first);
  options.map.reading_sigma_px = kReading;
  const PlannedRig plan = PlanLab(nominal, options);
  const UncertaintyMap map = MapUncertainty(plan.rig, plan.sees, options.map);
  std::vector<Squares> all(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const TracedLab lab(700 + k);
    all[k] = InCells(lab, Reached(lab, *options.survey), map);
  });
  Squares sum;
  for (const Squares& one : all) {
    sum.found += one.found;
    sum.foretold += one.foretold;
  }
  const double ratio = std::sqrt(sum.found / sum.foretold);
  std::printf("%zu laboratories: %.3f of what was planned\n", kLabs, ratio);
  const double chance = 2.0 / std::sqrt(2.0 * 24.0 * static_cast<double>(kLabs));
  EXPECT_NEAR(ratio, 1.0, 0.1 + chance);
}

#ifndef UNFURL_SLOW_TESTS

// What a rig's glass does beside its model acts upon the next calibration as readings that scatter
// more do, and upon what is then found.
TEST(PlannedSurvey, OfARigHasItsFloors) {
  const TracedLab lab(700);
  PlanOptions options;
  options.survey = PlannedPoints(lab);
  options.map.reading_sigma_px = kReading;
  options.map.columns = 3;
  data::Rig rig = Reached(lab, *options.survey);
  constexpr double kFloor = 0.07;  // [px]
  for (data::RigCamera& camera : rig.cameras) camera.floor_px = kFloor;
  const PlannedRig with = PlanRig(rig, options);
  const UncertaintyMap map = MapUncertainty(with.rig, with.sees, options.map);
  for (data::RigCamera& camera : rig.cameras) camera.floor_px = 0.0;
  rig.model_floor_px = 0.0;
  options.map.reading_sigma_px = std::hypot(kReading, kFloor);
  const PlannedRig without = PlanRig(rig, options);
  const UncertaintyMap noisy = MapUncertainty(without.rig, without.sees, options.map);
  ASSERT_GT(noisy.Found(), 0.5);
  // Both are the same bundle; 1e-3 for where its steps end.
  for (const double p : {0.1, 0.5, 0.9}) {
    EXPECT_NEAR(map.Quantile(p), noisy.Quantile(p), 1e-3 * noisy.Quantile(p));
  }
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::plan_test
