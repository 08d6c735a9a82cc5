// Second set-ups of the station that nobody names, rays traced through glass: found where they do
// harm, and not seen where there is none.
#include "calib/set_up_scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "base/worker_pool.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "tests/calib/set_up_fixtures.h"
#include "tests/calib/traced.h"

namespace unfurl::calib::set_up_scan_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::Named;
using testing::NeesOf;
using testing::TracedLab;
using testing::TwoSetUps;

Trend ScanOf(const Observations& data) {
  const RigFit fit = FitRig(data, {.workers = 1}, "test");
  return ScanSetUps(data, fit.priors, fit.bundle).trend;
}

// Surveys of one set-up: chances below 10% in no more than a tenth of them, as the price for
// having looked at many parts that overlap is too high; four sigmas of a binomial.
void ExpectLeftAlone(std::size_t surveys) {
  std::vector<double> chance(surveys);
  ParallelFor(surveys, 0,
              [&](std::size_t k) { chance[k] = ScanOf(TracedLab(3000 + k).Survey(120)).chance; });
  const auto n = static_cast<double>(surveys);
  const auto below = [&](double level) {
    double sum = 0.0;
    for (const double one : chance) sum += one < level ? 1.0 : 0.0;
    return sum / n;
  };
  std::printf("%zu surveys: %.3f below 1%%, %.3f below 10%%\n", surveys, below(0.01), below(0.1));
  EXPECT_LT(below(0.01), 0.01 + 4.0 * std::sqrt(0.01 * 0.99 / n));
  EXPECT_LT(below(0.1), 0.1 + 4.0 * std::sqrt(0.1 * 0.9 / n));
}

#ifdef UNFURL_SLOW_TESTS
TEST(SetUpScanOverManySurveys, LeavesOneSetUpAlone) { ExpectLeftAlone(200); }
#else

TEST(SetUpScan, LeavesOneSetUpAlone) { ExpectLeftAlone(10); }

// Off by 2.5 sigmas of a point, beyond a plane across none of the directions that are looked at: no
// other test saw it (decision 167).
TEST(SetUpScan, FindsAPartThatIsOff) {
  const TracedLab lab(25);
  Observations data = lab.Survey(200);
  const TwoSetUps two(data.p, Eigen::Vector3d(0.31, 0.84, -0.45));
  for (const int i : two.of_b) {
    data.p.col(i) += 2.5 * lab.survey_sigma * Eigen::Vector3d(0.6, -0.64, 0.48);
  }
  const Calibration result = Calibrate(data, {.order = kFullOrder}, "test");
  EXPECT_EQ(result.rig.verdict, kWithCare);
  EXPECT_THAT(result.rig.reasons, Contains(AllOf(HasSubstr("are off from the others as one"),
                                                 HasSubstr("in a column set_up"))));
  // Where it is named there is nothing left to find.
  AddSetUps(Named(data, two.names), "test", &data);
  EXPECT_EQ(Calibrate(data, {.order = kFullOrder}, "test").rig.verdict, kGood);
  EXPECT_EQ(ScanOf(data).text, "");
}

// From the middle of the file on, wherever the points lie.
TEST(SetUpScan, FindsFromWhichPointOn) {
  const TracedLab lab(26);
  Observations data = lab.Survey(200);
  data.p.rightCols(100).colwise() += 3.0 * lab.survey_sigma * Eigen::Vector3d::UnitX();
  const Trend found = ScanOf(data);
  EXPECT_TRUE(found.found);
  EXPECT_THAT(found.text, AllOf(HasSubstr("100 of the surveyed places, from \"p101\" on"),
                                HasSubstr("was the station moved?")));
  EXPECT_NEAR(found.rms, 3.0 * lab.survey_sigma, lab.survey_sigma);
}

// Distances of another scale from the middle of the file on, as with another correction for the
// air; by one and a half sigmas of a point at the edge of the volume, and about the volume's
// middle. The error bars hold it.
TEST(SetUpScan, FindsAnotherScale) {
  const TracedLab lab(26);
  Observations data = lab.Survey(200);
  data.p.rightCols(100) *= 1.0 + 1.5 * lab.survey_sigma / lab.half;
  const RigFit fit = FitRig(data, {.workers = 1}, "test");
  const SetUpScan scan = ScanSetUps(data, fit.priors, fit.bundle);
  EXPECT_TRUE(scan.trend.found);
  EXPECT_THAT(scan.trend.text,
              AllOf(HasSubstr("from \"p101\" on"), HasSubstr("their scale is off by"),
                    HasSubstr("measured otherwise")));
  data::Rig rig = fit.rig;
  const double without = NeesOf(lab, rig, 100);
  rig.covariance += scan.covariance;
  const double with = NeesOf(lab, rig, 100);
  std::printf("NEES/3 %.2f, with what may be off %.2f\n", without, with);
  EXPECT_GT(without, 1.5);
  EXPECT_LT(with, 1.3);
}

// Of a sound survey error bars are little longer for what may be off, and no longer where it says
// that it was measured from one place.
TEST(SetUpScan, AddsLittleToASoundSurvey) {
  const TracedLab lab(26);
  Observations data = lab.Survey(200);
  const RigFit fit = FitRig(data, {.workers = 1}, "test");
  data::Rig rig = fit.rig;
  rig.covariance += ScanSetUps(data, fit.priors, fit.bundle).covariance;
  const double share = NeesOf(lab, rig, 100) / NeesOf(lab, fit.rig, 100);
  std::printf("squared errors over what is stated: %.3f of those before\n", share);
  EXPECT_LT(share, 0.999);
  EXPECT_GT(share, 0.75);
  data.set_ups_told = true;
  EXPECT_TRUE(ScanSetUps(data, fit.priors, fit.bundle).covariance.isZero(0.0));
}

// How a set-up that is named stands is estimated; of which scale its distances are, is not.
TEST(SetUpScan, FindsTheScaleOfANamedOne) {
  const TracedLab lab(25);
  Observations data = lab.Survey(200);
  const TwoSetUps two(data.p, Eigen::Vector3d(0.31, 0.84, -0.45));
  for (const int i : two.of_b) {
    data.p.col(i) += 3.0 * lab.survey_sigma / two.arm * (data.p.col(i) - two.middle);
  }
  AddSetUps(Named(data, two.names), "test", &data);
  const Trend found = ScanOf(data);
  EXPECT_TRUE(found.found);
  EXPECT_THAT(found.text, AllOf(HasSubstr("80 of the surveyed places, of set-up \"B\""),
                                HasSubstr("measured otherwise")));
}

// Too few points.
TEST(SetUpScan, LooksAtNothingElse) {
  const TracedLab lab(27);
  EXPECT_EQ(ScanOf(lab.Survey(25)).chance, 1.0);
}

#endif  // UNFURL_SLOW_TESTS

}  // namespace
}  // namespace unfurl::calib::set_up_scan_test
