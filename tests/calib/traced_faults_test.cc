// What goes wrong in a laboratory, with rays through its glass: gross errors, cameras lost or
// standing together, few or flat points. Works, or refuses by name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/random_vector.h"
#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::traced_faults_test {
namespace {

using ::testing::AllOf;
using testing::FindCheckPoints;
using ::testing::HasSubstr;
using testing::TracedLab;

constexpr std::size_t kLabs = testing::Labs(3, 60);

struct Tally {
  double clean = 0.0, gross = 0.0;  // squared errors of found points [m^2]
  int planted = 0, found = 0, best = 0, good = 0, false_alarms = 0, best_false = 0;
  int large = 0, large_found = 0;  // of 20 sigmas and more
};

// A tenth of the readings, or of the surveyed points, wrong by 10 to 1000 sigmas, as likely in each
// decade.
Tally PlantThroughGlass(bool survey) {
  std::vector<Tally> all(kLabs);
  ParallelFor(kLabs, 0, [&](std::size_t k) {
    const TracedLab lab(900 + k);
    Observations data = lab.Survey(200);
    Tally& out = all[k];
    out.clean = FindCheckPoints(lab, FitRig(data, {}, "test").rig, 150).Squares();
    Rng rng = lab.rng.Stream("gross");
    // In sigmas; 0: sound.
    std::vector<double> bad_reading(data.readings.size(), 0.0), bad_point(data.ids.size(), 0.0);
    for (double& size : survey ? bad_point : bad_reading) {
      if (rng.Uniform() < 0.1) size = std::pow(10.0, rng.Uniform(1.0, 3.0));
    }
    for (std::size_t i = 0; i < bad_point.size(); ++i) {
      if (bad_point[i] == 0.0) continue;
      const Eigen::Vector3d way = NormalVector(&rng);
      data.p.col(static_cast<Eigen::Index>(i)) +=
          testing::kTracedSurvey * bad_point[i] * way.normalized();
    }
    for (std::size_t r = 0; r < bad_reading.size(); ++r) {
      if (bad_reading[r] == 0.0) continue;
      const double sign = rng.Uniform() < 0.5 ? -1.0 : 1.0;
      data.readings[r].u_px += sign * testing::kTracedReading * bad_reading[r];
    }
    const RigFit fit = FitRig(data, {}, "test");
    out.gross = FindCheckPoints(lab, fit.rig, 150).Squares();
    // Nearly the true cameras: of 800 points.
    const Weighting best = testing::BestGross(
        data, FitRig(lab.Survey(testing::PointsInCube(800, testing::kTracedHalf, rng)), {}, "test")
                  .rig.cameras);
    const auto count = [&](double size, bool flagged, bool by_best) {
      const bool bad = size > 0.0;
      (bad ? out.planted : out.good) += 1;
      if (flagged) (bad ? out.found : out.false_alarms) += 1;
      if (by_best) (bad ? out.best : out.best_false) += 1;
      if (size < 20.0) return;
      ++out.large;
      out.large_found += flagged ? 1 : 0;
    };
    const Weighting& ours = fit.bundle.weighting;
    for (std::size_t r = 0; r < bad_reading.size(); ++r) {
      count(bad_reading[r], !ours.Uses(r), !best.Uses(r));
    }
    for (std::size_t i = 0; i < bad_point.size(); ++i) {
      count(bad_point[i], !ours.UsesSurvey(i), !best.UsesSurvey(i));
    }
  });
  Tally sum;
  for (const Tally& one : all) {
    sum.clean += one.clean;
    sum.gross += one.gross;
    sum.planted += one.planted;
    sum.found += one.found;
    sum.best += one.best;
    sum.good += one.good;
    sum.false_alarms += one.false_alarms;
    sum.best_false += one.best_false;
    sum.large += one.large;
    sum.large_found += one.large_found;
  }
  std::printf(
      "%s: error %.3f times clean, %.2f%% of %d found (at best %.2f%%), of 20 sigmas and more "
      "%.2f%%, %.3f%% of %d false (at best %.3f%%)\n",
      survey ? "survey" : "readings", std::sqrt(sum.gross / sum.clean),
      100.0 * sum.found / sum.planted, sum.planted, 100.0 * sum.best / sum.planted,
      100.0 * sum.large_found / sum.large, 100.0 * sum.false_alarms / sum.good, sum.good,
      100.0 * sum.best_false / sum.good);
  return sum;
}

void ExpectFound(const Tally& sum) {
  EXPECT_LT(std::sqrt(sum.gross / sum.clean), 1.2);
  EXPECT_GE(sum.found, 0.95 * sum.best);
  EXPECT_GE(sum.large_found, 0.95 * sum.large);
  EXPECT_LE(sum.false_alarms, 0.01 * sum.good);
}

// Readings of 0.03 px beside a survey of 0.3 mm, which is 0.2 px: an error of 10 sigmas hides in
// the survey's, and what can be asked of the small ones is nearly what the true cameras would find.
TEST(TracedGross, TenPercentOfTheReadings) { ExpectFound(PlantThroughGlass(false)); }
TEST(TracedGross, TenPercentOfTheSurvey) { ExpectFound(PlantThroughGlass(true)); }

// Squared errors over what the rig says of them, of several laboratories and points.
struct Ratio {
  double squares = 0.0, bound = 0.0;
  void Add(const testing::TracedErrors& errors) {
    squares += errors.Squares();
    bound += errors.Bounds();
  }
  double Get() const { return std::sqrt(squares / bound); }
};

// A survey with three of the cameras only: which one is missing is of no matter.
TEST(TracedFaults, AnyCameraMayBeMissing) {
  for (int lost = 0; lost < 4; ++lost) {
    Ratio ratio;
    for (std::uint64_t seed = 1; seed <= kLabs / 2; ++seed) {
      const TracedLab lab(seed);
      Observations data = lab.Survey(200);
      std::erase_if(data.readings, [&](const Reading& r) { return r.camera == lost; });
      for (Reading& r : data.readings) r.camera -= r.camera > lost ? 1 : 0;
      data.cameras.erase(data.cameras.begin() + lost);
      const RigFit fit = FitRig(data, {}, "test");
      ASSERT_EQ(fit.rig.cameras.size(), 3U);
      ratio.Add(FindCheckPoints(lab, fit.rig, 150));
    }
    // A calibration's RMS has some 24 degrees of freedom: 15% for one, two standard errors.
    EXPECT_NEAR(ratio.Get(), 1.0, 2.0 / std::sqrt(2.0 * 24.0 * kLabs / 2) + 0.05) << lost;
  }
}

#ifndef UNFURL_SLOW_TESTS

TEST(TracedFaults, ThreeCamerasAreToBeUsedWithCare) {
  const TracedLab lab(3);
  Observations data = lab.Survey(120);
  std::erase_if(data.readings, [](const Reading& r) { return r.camera == 3; });
  data.cameras.pop_back();
  const Calibration result = Calibrate(data, {}, "test");
  EXPECT_EQ(result.rig.verdict, kWithCare);
  EXPECT_THAT(result.rig.reasons, ::testing::Contains(HasSubstr("three cameras")));
}

TEST(TracedFaults, TwelvePointsWorkAndSaySo) {
  Ratio ratio;
  int rigs = 0;
  for (std::uint64_t seed = 31; seed < 36; ++seed) {
    const TracedLab lab(seed);
    const Observations data = lab.Survey(testing::PointsInCube(12, 0.85, lab.rng.Stream("twelve")));
    if (data.readings.size() < 48) continue;  // a camera that sees fewer refuses by name
    const Calibration result = Calibrate(data, {.order = kFullOrder}, "test");
    EXPECT_NE(result.rig.verdict, kGood);
    ratio.Add(FindCheckPoints(lab, result.rig, 100, -1, 0.5));
    ++rigs;
  }
  ASSERT_GE(rigs, 3);
  EXPECT_LT(ratio.Get(), 2.0);
}

// Held-out points of few contradict each other by what their cameras are not known to, and are
// found nonetheless: of 45, six to eleven were not, and "too few cameras" were said to see them.
TEST(TracedFaults, FewPointsAreFoundWhenHeldOut) {
  TracedLab lab(24);
  lab.reading_sigma = 0.01;
  const Calibration result = Calibrate(lab.Survey(45), {}, "test");
  EXPECT_EQ(result.report.held_out_unsolved, 0);
  EXPECT_EQ(result.rig.verdict, kGood) << result.rig.reasons.front();
}

std::string Refusal(const Observations& data) {
  try {
    FitRig(data, {}, "survey.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(TracedFaults, FlatSurveysAreRefusedByName) {
  const TracedLab lab(5);
  Eigen::Matrix3Xd places = lab.Places(80);
  places.row(2).setConstant(0.1);
  EXPECT_THAT(Refusal(lab.Survey(places)), AllOf(HasSubstr("survey.csv"), HasSubstr("coplanar")));
  places.row(1) = 0.4 * places.row(0);
  EXPECT_THAT(Refusal(lab.Survey(places)), HasSubstr("collinear"));
}

TEST(TracedFaults, TwoCamerasInOnePlaceWorkAndCopiesAreRefused) {
  TracedLab lab(6);
  const std::string name = lab.truth.cameras[3].name;
  lab.truth.cameras[3] = lab.truth.cameras[0];
  lab.truth.cameras[3].name = name;
  Observations data = lab.Survey(150);
  const RigFit fit = FitRig(data, {}, "test");
  Ratio ratio;
  ratio.Add(FindCheckPoints(lab, fit.rig, 150));
  EXPECT_NEAR(ratio.Get(), 1.0, 0.5);  // 24 independent errors in one calibration
  for (Reading& r : data.readings) {
    if (r.camera != 3) continue;
    for (const Reading& first : data.readings) {
      if (first.camera == 0 && first.point == r.point) r.u_px = first.u_px;
    }
  }
  EXPECT_THAT(Refusal(data), HasSubstr("very same readings"));
}

std::string TextOf(const std::vector<GrossFinding>& findings, GrossKind kind) {
  for (const GrossFinding& finding : findings) {
    if (finding.kind == kind) return finding.text;
  }
  return "";
}

// Swapped, mislabelled, mirrored and wrongly measured data among sound ones, all at once.
TEST(TracedFaults, SlipsAreNamed) {
  const TracedLab lab(7);
  Observations data = lab.Survey(150);
  std::vector<int> seen(150, 0);
  for (const Reading& r : data.readings) ++seen[static_cast<std::size_t>(r.point)];
  std::vector<int> whole;  // points that all four cameras see
  for (int i = 0; i < 150; ++i) {
    if (seen[static_cast<std::size_t>(i)] == 4) whole.push_back(i);
  }
  ASSERT_GT(whole.size(), 40U);
  const auto id = [&](std::size_t k) {
    return "\"" + data.ids[static_cast<std::size_t>(whole[k])] + "\"";
  };
  data.p.col(whole[0]).swap(data.p.col(whole[1]));
  // Readings of whole[2] taken at whole[3]; its own survey stays.
  for (Reading& r : data.readings) {
    if (r.point != whole[2]) continue;
    for (const Reading& other : data.readings) {
      if (other.point == whole[3] && other.camera == r.camera) r.u_px = other.u_px;
    }
  }
  data.p(2, whole[4]) = -data.p(2, whole[4]);
  for (Reading& r : data.readings) {
    if (r.point == whole[5] && r.camera == 1) r.u_px = 2159.0 - r.u_px;
  }
  data.pixels.assign(4, 2160);
  const Eigen::Vector3d station(4.0, -3.0, 0.5);
  for (std::size_t k = 10; k < 18; ++k) {
    const Eigen::Vector3d way = data.p.col(whole[k]) - station;
    data.p.col(whole[k]) += 34.4e-3 * way.normalized();
  }
  const auto findings = ExplainGross(data, FitRig(data, {}, "test").bundle, {});
  EXPECT_THAT(TextOf(findings, GrossKind::kSwappedPoints),
              AllOf(HasSubstr(id(0)), HasSubstr(id(1))));
  EXPECT_THAT(TextOf(findings, GrossKind::kMislabelled), AllOf(HasSubstr(id(2)), HasSubstr(id(3))));
  EXPECT_THAT(TextOf(findings, GrossKind::kMirroredAxis), HasSubstr(id(4)));
  EXPECT_THAT(TextOf(findings, GrossKind::kMirroredReading), HasSubstr(id(5)));
  EXPECT_THAT(TextOf(findings, GrossKind::kPrismConstant),
              AllOf(HasSubstr("8 points"), HasSubstr("34.4")));
  EXPECT_EQ(findings.size(), 5U);
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::traced_faults_test
