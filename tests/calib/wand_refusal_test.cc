// What a bar's readings do not determine is refused, or said.
#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "calib/verdict.h"
#include "calib/wand.h"
#include "calib/wand_verdict.h"
#include "tests/calib/wand_fixtures.h"

namespace unfurl::calib::wand_refusal_test {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::MakeRig;
using testing::MarksRms;
using testing::Wave;
using testing::WaveBefore;
using testing::Waved;
using testing::WithPoints;

std::string RefusalOf(const WandData& data) {
  try {
    FitWand(data, {}, "wand.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

WandCalibration Calibrated(const WandData& data) {
  WandOptions options;
  options.folds = 2;
  return CalibrateWand(data, options, "wand.csv");
}

// Poses that contradict the rest take no part in anything that follows: data, volume, residuals.
TEST(WandRefusal, PosesThatContradictTheRestAreGone) {
  const auto truth = MakeRig({}, Rng(21));
  Waved waved = WaveBefore(truth, {.poses = 120, .half = 0.8}, Rng(21));
  Rng rng(22);
  const std::vector<int> spoilt = {3, 40, 77, 118};
  for (WandReading& r : waved.data.readings) {
    if (std::find(spoilt.begin(), spoilt.end(), r.pose) == spoilt.end()) continue;
    r.u_px = rng.Uniform(100.0, 2000.0);
  }
  const WandCalibration found = Calibrated(waved.data);
  for (const int pose : spoilt) {
    const std::string& name = waved.data.poses[static_cast<std::size_t>(pose)];
    EXPECT_THAT(found.report.lost_poses, Contains(name));
    EXPECT_THAT(found.fit.data.poses, ::testing::Not(Contains(name)));
  }
  EXPECT_LT(std::min(MarksRms(found.fit, waved, false), MarksRms(found.fit, waved, true)), 1e-3);
  // The volume is that of the bar: a cube of 1.6 m, in any frame, and half a bar at each side.
  EXPECT_LT((found.rig.volume_high - found.rig.volume_low).maxCoeff(), std::sqrt(3.0) * 2.4);
  int readings = 0, gross = 0;
  for (const WandCameraReport& camera : found.report.cameras) {
    readings += camera.readings;
    gross += camera.gross;
    EXPECT_LT(camera.residual_rms_px, 0.1);
  }
  EXPECT_EQ(readings, static_cast<int>(waved.data.readings.size()));
  EXPECT_EQ(gross, found.report.gross_readings);
  EXPECT_GE(gross, 4 * 8);
}

TEST(WandRefusal, ReadingsOfNoBar) {
  const auto truth = MakeRig({}, Rng(23));
  Waved waved = WaveBefore(truth, {.poses = 40, .half = 0.8}, Rng(23));
  Rng rng(24);
  for (WandReading& r : waved.data.readings) r.u_px = rng.Uniform(0.0, 2159.0);
  const std::string refusal = RefusalOf(waved.data);
  EXPECT_THAT(refusal, HasSubstr("wand.csv: "));
  EXPECT_THAT(refusal, HasSubstr("; "));  // a remedy
}

// One camera's two columns of the bar's ends the other way round.
TEST(WandRefusal, EndsThatOneCameraHasExchanged) {
  const auto truth = MakeRig({}, Rng(61));
  WandData data = WaveBefore(truth, {.poses = 100, .half = 0.8}, Rng(61)).data;
  for (WandReading& r : data.readings) r.mark = r.camera == 1 ? 1 - r.mark : r.mark;
  std::sort(data.readings.begin(), data.readings.end(),
            [](const WandReading& a, const WandReading& b) {
              return std::tie(a.pose, a.mark, a.camera) < std::tie(b.pose, b.mark, b.camera);
            });
  EXPECT_THAT(RefusalOf(data),
              HasSubstr("camera \"" + truth[1].name + "\" has marks \"a\" and \"b\" exchanged"));
}

TEST(WandRefusal, ACameraThatReadsTheSameInAllPoses) {
  const auto truth = MakeRig({}, Rng(23));
  WandData data = WaveBefore(truth, {.poses = 40, .half = 0.8}, Rng(23)).data;
  Rng rng(24);
  for (WandReading& r : data.readings)
    r.u_px = r.camera == 1 ? 700.0 + 0.02 * rng.Normal() : r.u_px;
  EXPECT_THAT(RefusalOf(data), HasSubstr("camera \"" + truth[1].name + "\" reads 700.0 px"));
}

TEST(WandRefusal, PointsInMillimetresUnderTheNameOfMetres) {
  const auto truth = MakeRig({}, Rng(33));
  Waved waved = WithPoints(truth, {.poses = 40, .half = 0.8}, 6, 33);
  waved.data.points.p *= 1e3;
  EXPECT_THAT(RefusalOf(waved.data), HasSubstr("millimetres under the name of metres; state"));
}

// No points, no plan: cameras a kilometre away.
TEST(WandRefusal, ALengthInMillimetresUnderTheNameOfMetres) {
  const auto truth = MakeRig({}, Rng(33));
  Waved waved = WaveBefore(truth, {.poses = 60, .half = 0.8}, Rng(33));
  waved.data.place *= 1e3;
  waved.data.place_sigma *= 1e3;
  const WandCalibration found = Calibrated(waved.data);
  EXPECT_EQ(found.rig.verdict, kDoNotUse);
  EXPECT_THAT(found.rig.reasons.front(),
              HasSubstr("the stated length of the bar is millimetres under the name of metres"));
}

// Three marks, one distance off by 6 and by 500 of its sigmas: neither surveyed points, which
// there are none of, nor cameras are to blame.
TEST(WandRefusal, MarksWhoseDistancesContradictEachOther) {
  const auto truth = MakeRig({}, Rng(34));
  for (const double off : {0.0, 1.2e-4, 1e-2}) {
    WandData data = WaveBefore(truth, {.poses = 80, .half = 0.8}, Rng(34)).data;
    const WandData half =
        WaveBefore(truth, {.poses = 80, .length = 0.3, .half = 0.8}, Rng(34)).data;
    data.marks = {"a", "b", "c"};
    // Both bars have the same middles and directions: marks at -0.375, -0.15 and 0.375 m.
    for (WandReading& r : data.readings) r.mark = r.mark == 1 ? 2 : 0;
    for (WandReading r : half.readings) {
      if (r.mark != 0) continue;
      r.mark = 1;
      data.readings.push_back(r);
    }
    std::stable_sort(
        data.readings.begin(), data.readings.end(), [](const WandReading& a, const WandReading& b) {
          return std::tie(a.pose, a.mark, a.camera) < std::tie(b.pose, b.mark, b.camera);
        });
    data.place = Eigen::Vector3d(0.0, 0.225 + off, 0.75);
    data.place_sigma = 2e-5;
    if (off > 1e-3) {
      EXPECT_THAT(RefusalOf(data), HasSubstr(" mm, and not at 235 mm"));
      continue;
    }
    const WandCalibration found = Calibrated(data);
    std::string reasons;
    for (const std::string& reason : found.rig.reasons) reasons += reason + "\n";
    if (off == 0.0) {
      EXPECT_NE(found.rig.verdict, kDoNotUse) << reasons;
      continue;
    }
    EXPECT_EQ(found.rig.verdict, kDoNotUse) << off;
    EXPECT_THAT(reasons, HasSubstr(" mm, and not at 225.12 mm")) << off;
    EXPECT_THAT(reasons, ::testing::Not(HasSubstr("by the surveyed points mark"))) << off;
    EXPECT_THAT(reasons, ::testing::Not(HasSubstr("as large as stated"))) << off;
  }
}

// Places that are off by a hundred sigmas are off themselves; each was left without the readings
// that contradict it, one by one, and the frame and error bars were those of the wrong length.
TEST(WandRefusal, PointsThatAllContradictTheLength) {
  for (std::uint64_t seed = 71; seed <= 74; ++seed) {
    const auto truth = MakeRig({}, Rng(seed).Stream("rig"));
    Waved waved = WithPoints(truth, {.poses = 120, .half = 0.8}, 8, seed);
    waved.data.place(1) *= 1.01;
    waved.data.place_sigma = 1e-4;
    const WandCalibration found = Calibrated(waved.data);
    EXPECT_EQ(found.rig.verdict, kDoNotUse) << seed;
    EXPECT_GT(found.report.gross_points.size(), 4U) << seed;
    EXPECT_THAT(found.rig.reasons.front(), HasSubstr("the stated length of the bar")) << seed;
    // Without them nothing held the frame, and error bars were metres, or no numbers. Held, it is
    // to 0.03 of the volume's RMS half side of 0.8 m, and to 0.03 rad.
    EXPECT_LT(found.rig.checks.at("point_sigma_median [m]"), 0.1) << seed;
  }
}

// One reading of a surveyed point, and one place: each is left out as what it is, and told.
TEST(WandRefusal, AWrongReadingAndAWrongPlaceOfThePoints) {
  const auto truth = MakeRig({}, Rng(75).Stream("rig"));
  Waved waved = WithPoints(truth, {.poses = 120, .half = 0.8}, 8, 75);
  Observations& points = waved.data.points;
  points.p(1, 2) += 0.03;
  for (Reading& r : points.readings) r.u_px += r.point == 5 && r.camera == 1 ? 5.0 : 0.0;
  const WandCalibration found = Calibrated(waved.data);
  EXPECT_EQ(found.report.gross_points, std::vector<std::string>{points.ids[2]});
  EXPECT_EQ(found.report.gross_point_readings, 1);
  EXPECT_NE(found.rig.verdict, kDoNotUse);
  EXPECT_THAT(found.rig.reasons, Contains(HasSubstr("left out: 1 of")));
}

TEST(WandRefusal, ThreeCamerasAndFewPosesLeaveNothingToCheckWith) {
  const auto truth = MakeRig({.cameras = 3}, Rng(25));
  const Waved waved = WaveBefore(truth, {.poses = 22, .half = 0.8}, Rng(25));
  EXPECT_THAT(RefusalOf(waved.data), HasSubstr("leave nothing over to check them with; wave"));
}

TEST(WandRefusal, AnotherRigThatFitsAsWell) {
  const auto truth = MakeRig({}, Rng(26));
  const Waved waved = WaveBefore(truth, {.poses = 60, .half = 0.8}, Rng(26));
  WandCalibration found = Calibrated(waved.data);
  ASSERT_TRUE(found.report.rivals.empty());
  ASSERT_NE(found.rig.verdict, kDoNotUse);
  found.report.rivals = {{0.01, 3.0}, {0.085, 12.0}};
  JudgeWand(found.fit, {1e-4}, found.report, {}, &found.rig);
  EXPECT_EQ(found.rig.verdict, kDoNotUse);
  EXPECT_THAT(found.rig.reasons.front(), HasSubstr("not determined: other cameras (2"));
  EXPECT_THAT(found.rig.reasons.front(), HasSubstr("85"));
}

// Of a bar that is always across one lens axis several rigs explain the readings.
TEST(WandRefusal, ABarThatNeverTurns) {
  const auto truth = MakeRig({}, Rng(27));
  Wave wave{.poses = 60, .half = 0.8};
  const auto never = [&](const Eigen::Vector3d& axis) {
    wave.limit = [axis](Eigen::Vector3d*, Eigen::Vector3d* direction) {
      *direction = (axis + 0.02 * *direction).normalized();
    };
    try {
      const WandCalibration found = Calibrated(WaveBefore(truth, wave, Rng(27)).data);
      EXPECT_NE(found.rig.verdict, kGood);
      const double edge = found.report.shapes[0].moved;
      // Named: the direction that the bar never pointed in, or that it is not determined at all.
      bool named = edge < 1e-3;
      for (const std::string& reason : found.rig.reasons) {
        named = named || reason.find("the bar pointed least along") != std::string::npos ||
                reason.find("not determined") != std::string::npos;
      }
      EXPECT_TRUE(named) << found.rig.reasons.front();
    } catch (const Error& error) {
      EXPECT_FALSE(error.remedy().empty());
    }
  };
  never(truth[0].R_CW.row(1).transpose());  // a lens axis
  never(Eigen::Vector3d::UnitZ());
}

TEST(WandRefusal, ABarInOnePlane) {
  const auto truth = MakeRig({}, Rng(28));
  Wave wave{.poses = 60, .half = 0.8};
  wave.limit = [](Eigen::Vector3d* middle, Eigen::Vector3d* direction) {
    middle->z() *= 0.01;
    direction->z() *= 0.01;
    direction->normalize();
  };
  try {
    const WandCalibration found = Calibrated(WaveBefore(truth, wave, Rng(28)).data);
    EXPECT_NE(found.rig.verdict, kGood);
    // A plane's readings lead to rigs of other shapes, too: then the bar "moved least along" a
    // line.
    EXPECT_THAT(found.rig.reasons, Contains(AnyOf(HasSubstr("the bar stayed in one plane"),
                                                  HasSubstr("moved least along"))));
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("plane"));
  }
}

// A bar that is known no better than to 3 per mille, as a short one is, gives no scale.
TEST(WandRefusal, ATooShortBar) {
  const auto truth = MakeRig({}, Rng(29));
  Wave wave{.poses = 80, .length = 0.03, .half = 0.8};
  const WandCalibration found = Calibrated(WaveBefore(truth, wave, Rng(29)).data);
  EXPECT_NE(found.rig.verdict, kGood);
  EXPECT_THAT(found.rig.reasons, Contains(HasSubstr("state the bar's length better")));
}

}  // namespace
}  // namespace unfurl::calib::wand_refusal_test
