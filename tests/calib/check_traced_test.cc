// Checks of calibrations with rays through the glass of laboratories of many kinds: cameras that
// were shifted are found and named, and others are not.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <optional>

#include "base/random_vector.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/check.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::check_traced_test {
namespace {

using testing::TracedLab;

#ifdef UNFURL_SLOW_TESTS
constexpr std::size_t kLabs = 100;  // 500 checks of rigs that stand, some 550 of shifted cameras
#else
constexpr std::size_t kLabs = 1;
#endif
constexpr int kDraws = 5;        // of a check, with one calibration
constexpr int kPlacements = 15;  // of a bar half as long as the volume

struct Case {
  TracedLab lab;
  data::Rig rig;
};

Case MakeCase(std::uint64_t seed, double reading_sigma) {
  double half = 0.0;
  const data::Lab kind = testing::RandomLab(seed, &half);
  Case out{TracedLab(kind, half, seed), {}};
  out.lab.reading_sigma = reading_sigma;
#ifdef UNFURL_SLOW_TESTS
  out.rig = Calibrate(out.lab.Survey(200), {.workers = 1}, "test").rig;
#else
  out.rig = FitRig(out.lab.Survey(200), {.workers = 1}, "test").rig;  // without choosing the order
#endif
  return out;
}

// Calibrated once for all tests.
const std::vector<Case>& Cases(double reading_sigma) {
  static std::map<double, std::vector<Case>> made;
  std::vector<Case>& cases = made[reading_sigma];
  if (!cases.empty()) return cases;
  std::vector<std::optional<Case>> found(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) { found[k] = MakeCase(300 + k, reading_sigma); });
  for (std::optional<Case>& one : found) cases.push_back(std::move(*one));
  return cases;
}

// Fresh noise, and places of its own.
Observations Points(const Case& one, std::uint64_t draw) {
  TracedLab lab = one.lab;
  lab.rng = one.lab.rng.Stream("check of points", draw);
  return lab.Survey(10);
}

Observations BarEnds(const Case& one, std::uint64_t draw) {
  TracedLab lab = one.lab;
  lab.rng = one.lab.rng.Stream("check by a bar", draw);
  Rng rng = lab.rng.Stream("placements");
  Eigen::Matrix3Xd ends(3, 2 * kPlacements);
  for (Eigen::Index k = 0; k < kPlacements; ++k) {
    Eigen::Vector3d way = NormalVector(&rng), middle;
    way *= 0.5 * lab.half / way.norm();
    for (double& x : middle) x = lab.half * rng.Uniform(-0.5, 0.5);
    ends.col(2 * k) = middle - way;
    ends.col(2 * k + 1) = middle + way;
  }
  return lab.Survey(ends);
}

CheckResult RunCheck(const Case& one, const Observations& data, bool bar) {
  return bar ? CheckBar(one.rig, data, {one.lab.half, 2e-5 * one.lab.half}, "test")
             : CheckPoints(one.rig, data, "test");
}

struct Tally {
  double tried = 0.0, found = 0.0, named = 0.0;  // shifted cameras
  double shown = 0.0, shown_found = 0.0,
         shown_named = 0.0;  // of those that the check said it shows
  void Add(const Tally& other) {
    tried += other.tried;
    found += other.found;
    named += other.named;
    shown += other.shown;
    shown_found += other.shown_found;
    shown_named += other.shown_named;
  }
};

// Each camera in turn shifted, a check for each.
Tally Shifted(double reading_sigma, double shift_px, bool bar) {
  const std::vector<Case>& cases = Cases(reading_sigma);
  std::vector<Tally> all(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const Case& one = cases[k];
    const Observations whole = bar ? BarEnds(one, 0) : Points(one, 0);
    for (int j = 0; j < static_cast<int>(one.rig.cameras.size()); ++j) {
      Observations data = whole;
      for (Reading& r : data.readings) r.u_px += r.camera == j ? shift_px : 0.0;
      const CheckResult result = RunCheck(one, data, bar);
      const bool found = result.chance < result.options.doubtful;
      // That camera, with any single readings beside it, and no other.
      bool named = found && !result.causes.empty();
      for (std::size_t m = 0; m < result.causes.size(); ++m) {
        const CheckedCause& cause = result.causes[m];
        named = named && (m == 0 ? cause.kind == CauseKind::kCamera && cause.camera == j
                                 : cause.kind == CauseKind::kReading);
      }
      const bool shown = result.cameras[static_cast<std::size_t>(j)].shows_px <= shift_px;
      all[k].Add({1.0, found ? 1.0 : 0.0, named ? 1.0 : 0.0, shown ? 1.0 : 0.0,
                  shown && found ? 1.0 : 0.0, shown && named ? 1.0 : 0.0});
    }
  });
  Tally sum;
  for (const Tally& one : all) sum.Add(one);
  std::printf(
      "%s, readings %.3f px, cameras shifted by %.1f px: %.0f, found %.0f, named %.0f; the "
      "check says that it shows %.0f, found %.0f, named %.0f\n",
      bar ? "bar" : "points", reading_sigma, shift_px, sum.tried, sum.found, sum.named, sum.shown,
      sum.shown_found, sum.shown_named);
  return sum;
}

double FalseAlarms(double reading_sigma, bool bar) {
  const std::vector<Case>& cases = Cases(reading_sigma);
  std::vector<double> alarms(kLabs, 0.0);
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const Case& one = cases[k];
    for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
      const CheckResult result = RunCheck(one, bar ? BarEnds(one, draw) : Points(one, draw), bar);
      alarms[k] += result.chance < result.options.doubtful ? 1.0 : 0.0;
    }
  });
  double sum = 0.0;
  for (const double one : alarms) sum += one;
  std::printf("%s, readings %.3f px: %.0f false alarms of %zu\n", bar ? "bar" : "points",
              reading_sigma, sum, kDraws * kLabs);
  return sum;
}

// What was asked: 1% +- 1%; with few draws, what 2% give but once in a hundred.
void ExpectFewFalseAlarms(double alarms) {
  const double n = kDraws * kLabs;
  EXPECT_LE(alarms, std::max(0.02 * n, 2.0));
}

TEST(CheckBarTraced, EachCameraByAPixelIsFoundAndNamed) {
  for (const double sigma : {0.01, 0.05}) {
    const Tally sum = Shifted(sigma, 1.0, true);
    EXPECT_EQ(sum.found, sum.tried);
    EXPECT_EQ(sum.named, sum.tried);
  }
}

TEST(CheckBarTraced, AFifthOfAPixelWhereTheBarCanShowIt) {
  const Tally sum = Shifted(0.05, 0.2, true);
  ASSERT_GT(sum.shown, 0.0);
  EXPECT_GE(sum.shown_found, 0.9 * sum.shown);
  EXPECT_GE(sum.shown_named, 0.9 * sum.shown);
}

TEST(CheckBarTraced, RigsThatStandAreLeftAlone) { ExpectFewFalseAlarms(FalseAlarms(0.05, true)); }
TEST(CheckBarTraced, RigsThatStandPreciseReadings) {
  ExpectFewFalseAlarms(FalseAlarms(0.01, true));
}

TEST(CheckPointsTraced, ACameraByAPixelIsNamedByTenPoints) {
  for (const double sigma : {0.01, 0.05}) {
    const Tally sum = Shifted(sigma, 1.0, false);
    EXPECT_GE(sum.named, 0.95 * sum.tried);
  }
}

TEST(CheckPointsTraced, RigsThatStandAreLeftAlone) {
  ExpectFewFalseAlarms(FalseAlarms(0.05, false));
}
TEST(CheckPointsTraced, RigsThatStandPreciseReadings) {
  ExpectFewFalseAlarms(FalseAlarms(0.01, false));
}

}  // namespace
}  // namespace unfurl::calib::check_traced_test
