// What surveying costs: whether calibrations through glass reach what was foretold of them.
#include "calib/survey_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "base/error.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "measure/triangulate.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::survey_cost_test {
namespace {

using testing::TracedLab;

constexpr std::size_t kLabs = testing::Labs(1, 20);

// A rig as it is known: by a survey of many points.
data::Rig Known(const TracedLab& lab) {
  data::Rig rig = FitRig(lab.Survey(kLabs > 1 ? 300 : 120), {.workers = 1}, "test").rig;
  rig.volume_low.setConstant(-1.0);
  rig.volume_high.setConstant(1.0);
  return rig;
}

SurveyCostOptions Options() {
  SurveyCostOptions out;
  out.poses = {};
  out.draws = 0;
  out.workers = 1;
  out.columns = 5;
  return out;
}

struct Squares {
  double found = 0.0, foretold = 0.0;
};

// The survey of a setting as somebody then makes it, calibrated, and what points are off by.
Squares Made(const TracedLab& lab, const data::Rig& known, const SurveySetting& setting,
             const SurveyCostOptions& options) {
  TracedLab again = lab;
  again.rng = lab.rng.Stream("made");
  again.survey_sigma = options.point_sigma;
  again.reading_sigma = options.reading_sigma_px / std::sqrt(setting.shots);
  const data::Survey survey = SurveyOf(known, setting, options);
  const data::Rig rig = Calibrate(again.Survey(survey.p), {.workers = 1}, "test").rig;
  const measure::Triangulator triangulator(rig, {.residual_level = 1e-12});
  Rng noise = lab.rng.Stream("found");
  const std::size_t cameras = rig.cameras.size();
  std::vector<double> u(cameras), s(cameras, options.reading_sigma_px);
  double squares = 0.0, n = 0.0;
  for (int k = 0; k < options.columns * options.columns * options.layers; ++k) {
    const Eigen::Vector3d share((k % options.columns + 0.5) / options.columns,
                                (k / options.columns % options.columns + 0.5) / options.columns,
                                (k / options.columns / options.columns + 0.5) / options.layers);
    const Eigen::Vector3d p =
        known.volume_low + (known.volume_high - known.volume_low).cwiseProduct(share);
    for (std::size_t c = 0; c < cameras; ++c) {
      u[c] = std::numeric_limits<double>::quiet_NaN();
      if (lab.Read(c, p, &u[c])) u[c] += options.reading_sigma_px * noise.Normal();
    }
    const auto point = triangulator.Solve(u, s, p);
    if (point.outcome != measure::PointOutcome::kSolved) continue;
    squares += (point.p - p).squaredNorm();
    n += 1.0;
  }
  return {squares / n, setting.error * setting.error};
}

// A calibration's error is some 24 numbers.
TEST(SurveyCost, IsWhatCalibrationsThenReach) {
  SurveyCostOptions options = Options();
#ifdef UNFURL_SLOW_TESTS
  options.points = {50, 100, 200};
  options.places = {SurveyPlaces::kVolume, SurveyPlaces::kLevels};
  options.shots = {1, 16};
#else
  options.points = {100};
  options.places = {SurveyPlaces::kVolume};
  options.shots = {1};
#endif
  std::vector<std::vector<Squares>> all(kLabs);
  std::vector<SurveySetting> names;
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const TracedLab lab(900 + k);
    const data::Rig rig = Known(lab);
    const SurveyCost cost = StudySurveyCost(rig, "test", options);
    if (k == 0) names = cost.settings;
    for (const SurveySetting& one : cost.settings) {
      if (one.lens.empty()) all[k].push_back(Made(lab, rig, one, options));
    }
  });
  const double chance = 2.0 / std::sqrt(2.0 * 24.0 * static_cast<double>(kLabs));
  for (std::size_t s = 0; s < all.front().size(); ++s) {
    Squares sum;
    for (const auto& of_lab : all) {
      sum.found += of_lab[s].found;
      sum.foretold += of_lab[s].foretold;
    }
    const double ratio = std::sqrt(sum.found / sum.foretold);
    std::printf("%d points, %s, %d shots: %.3f of what was foretold, %.3f mm (%zu laboratories)\n",
                names[s].points, Name(names[s].places), names[s].shots, ratio, 1e3 * names[s].error,
                kLabs);
    // What is foretold is of all terms of the lens. Where points at few heights tell them badly,
    // calibrate takes fewer, and does better.
    EXPECT_LT(ratio, 1.1 + chance);
    const bool everywhere = names[s].places == SurveyPlaces::kVolume;
    EXPECT_GT(ratio, everywhere ? 0.9 - chance : 0.0);
  }
}

#ifndef UNFURL_SLOW_TESTS

TEST(SurveyCost, AdvisesTheQuickestThatReachesTheNeed) {
  const data::Rig rig = Known(TracedLab(5));
  SurveyCostOptions options = Options();
  options.points = {25, 60};
  options.shots = {1};
  options.poses = {40};
  options.draws = 1;
  const SurveyCost loose = StudySurveyCost(rig, "test", options);
  // More points, and points everywhere, are better; hours are counted as they are told.
  const auto& s = loose.settings;
  EXPECT_GT(s[0].error, s[3].error);
  EXPECT_LT(s[3].error, s[5].error);
  EXPECT_NEAR(s[3].hours, 0.5 + 60 * (1.5 + 0.1 / 60.0) / 60.0, 1e-9);
  EXPECT_NEAR(s[6].hours, 0.5 + (8 * (1.5 + 0.1 / 60.0) + 40 * 0.1) / 60.0, 1e-9);
  EXPECT_TRUE(s[6].problem.empty()) << s[6].problem;
  // Wild readings matter to ordinary least squares.
  EXPECT_LT(5.0 * s[s.size() - 2].error, s.back().error);
  options.draws = 0;
  options.poses = {};
  options.places = {SurveyPlaces::kVolume};
  options.need = 1.01 * s[3].error;
  EXPECT_EQ(StudySurveyCost(rig, "test", options).advised, 1);
  options.need = 1e-9;
  EXPECT_EQ(StudySurveyCost(rig, "test", options).advised, -1);
  options.points = {3};
  EXPECT_THROW(StudySurveyCost(rig, "test", options), Error);
  EXPECT_THROW(ParseSurveyPlaces("nowhere", "--places"), Error);
}

#endif

}  // namespace
}  // namespace unfurl::calib::survey_cost_test
