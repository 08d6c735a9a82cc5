// A camera that moved late in a survey: most of its readings are from before, and what was read
// since is left out.
#include "calib/moved_late.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitset>
#include <cmath>
#include <string>
#include <vector>

#include "base/pose.h"
#include "calib/calibrate.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "tests/calib/fixtures.h"
#include "tests/calib/wand_fixtures.h"

namespace unfurl::calib::moved_late_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using testing::MakeRig;
using testing::Observe;
using testing::PointsInCube;

// By counting every way in which 4 of 11 may be marked.
TEST(MovedLate, ChanceIsWhatCountingGives) {
  constexpr std::size_t kAll = 11, kMarked = 4;
  for (std::size_t last = 1; last <= kAll; ++last) {
    for (std::size_t least = 0; least <= kMarked; ++least) {
      int ways = 0, such = 0;
      for (unsigned set = 0; set < 1U << kAll; ++set) {
        const std::bitset<kAll> marked(set);
        if (marked.count() != kMarked) continue;
        ++ways;
        std::size_t among = 0;
        for (std::size_t k = kAll - last; k < kAll; ++k) among += marked[k];
        such += among >= least;
      }
      EXPECT_NEAR(ChanceOfLast(kAll, kMarked, last, least), static_cast<double>(such) / ways,
                  1e-12);
    }
  }
}

// A fit of 4 cameras by 150 points, of whose readings `left_out` says which took no part.
template <typename LeftOut>
std::vector<Trend> Find(const LeftOut& left_out) {
  Observations data;
  RefinedBundle bundle;
  for (int c = 0; c < 4; ++c) data.cameras.push_back("c" + std::to_string(c + 1));
  for (int i = 0; i < 150; ++i) {
    data.ids.push_back("p" + std::to_string(i + 1));
    for (int c = 0; c < 4; ++c) {
      data.readings.push_back({i, c, 1000.0, 0.05});
      bundle.weighting.use_reading.push_back(left_out(i, c) ? 0 : 1);
      bundle.summary.residual_px.push_back(left_out(i, c) ? -3.0 : 0.0);
    }
  }
  return FindMovedLate(data, bundle, 0.01);
}

// Readings that are wrong anywhere: one survey in a hundred is suspected, or fewer.
TEST(MovedLate, WildReadingsAreSeldomTakenForAMove) {
  constexpr int kSurveys = 2000;
  for (const double share : {0.003, 0.03, 0.15}) {
    Rng rng(5);
    int suspected = 0;
    for (int k = 0; k < kSurveys; ++k) {
      std::vector<char> wild(600);
      for (char& w : wild) w = rng.Uniform() < share ? 1 : 0;
      suspected += !Find([&](int i, int c) {
                      return wild[static_cast<std::size_t>(4 * i + c)] != 0;
                    }).empty();
    }
    // Four standard errors above a hundredth.
    EXPECT_LE(suspected, 0.01 * kSurveys + 4.0 * std::sqrt(0.01 * kSurveys)) << share;
  }
}

TEST(MovedLate, TheLastOfACameraAreFound) {
  for (const int last : {3, 8, 30}) {
    const auto found = Find([&](int i, int c) { return c == 2 && i >= 150 - last; });
    ASSERT_EQ(found.size(), 1U) << last;
    EXPECT_EQ(found[0].camera, 2);
    EXPECT_NEAR(found[0].change, -3.0, 1e-12);
    EXPECT_THAT(found[0].text, HasSubstr("from point \"p" + std::to_string(151 - last) + "\" on"));
  }
  // Put back, or moved before most of it was read: the rig has it as it stands.
  EXPECT_TRUE(Find([](int i, int c) { return c == 2 && i >= 60 && i < 75; }).empty());
  EXPECT_TRUE(Find([](int i, int c) { return c == 2 && i < 15; }).empty());
  EXPECT_TRUE(Find([](int, int) { return false; }).empty());
}

// The whole calibration: a camera turns by 5 px when nine tenths are measured. Its readings since
// are gross errors to a fit that most of them decide, and the rig would be good but for where the
// camera stands now.
TEST(MovedLate, ARigWhoseCameraMovedIsNotGood) {
  const Rng rng(31);
  std::vector<data::RigCamera> before = MakeRig({}, rng.Stream("rig"));
  std::vector<data::RigCamera> after = before;
  after[1].R_CW = RotationFromVector({0.0, 5.0 / before[1].f_px, 0.0}) * before[1].R_CW;
  const Eigen::Matrix3Xd places = PointsInCube(150, 0.7, rng.Stream("places"));
  const Observations still = Observe(before, places, 3e-4, 0.05, rng.Stream("noise"));
  const Observations moved = Observe(after, places, 3e-4, 0.05, rng.Stream("noise"));
  Observations survey = still;
  std::erase_if(survey.readings, [](const Reading& r) { return r.point >= 135; });
  for (const Reading& r : moved.readings) {
    if (r.point >= 135) survey.readings.push_back(r);
  }
  EXPECT_EQ(Calibrate(still, {}, "test").rig.verdict, kGood);
  const Calibration found = Calibrate(survey, {}, "test");
  EXPECT_EQ(found.rig.verdict, kWithCare);
  EXPECT_THAT(found.rig.reasons,
              Contains(HasSubstr("camera \"c2\": of its last 15 readings, from point \"p136\" on, "
                                 "15 were left out")));
}

// A bar's poses: of the last five nothing tells which camera's readings are wrong, and they are
// left out as a whole.
TEST(MovedLate, AWaveWhoseCameraMovedIsNotGood) {
  const auto truth = MakeRig({}, Rng(3).Stream("rig"));
  testing::Waved waved = testing::WithPoints(truth, {.poses = 150, .half = 0.8}, 8, 3);
  WandOptions options;
  options.folds = 2;
  EXPECT_EQ(CalibrateWand(waved.data, options, "wand").report.late, 0);
  for (WandReading& r : waved.data.readings) {
    if (r.camera == 1 && r.pose >= 145) r.u_px += 5.0;
  }
  const WandCalibration found = CalibrateWand(waved.data, options, "wand");
  EXPECT_NE(found.rig.verdict, kGood);
  EXPECT_EQ(found.report.late, 5);
  EXPECT_THAT(found.rig.reasons, Contains(HasSubstr("a camera moved before the bar was put away")));
}

}  // namespace
}  // namespace unfurl::calib::moved_late_test
