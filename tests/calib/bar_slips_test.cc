// What a whole file of a bar's readings, or its length, may be written as instead: each is named.
#include "calib/bar_slips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/random_vector.h"
#include "calib/check.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::bar_slips_test {
namespace {

using ::testing::HasSubstr;
using testing::MakeStudy;
using testing::Observe;
using testing::Study;

const Study& TheStudy() {
  static const Study study = MakeStudy(41);
  return study;
}
const data::Rig& TheRig() {
  static const data::Rig rig = FitRig(TheStudy().data, {}, "test").rig;
  return rig;
}

// Six placements of a bar of 1.2 m.
Observations Bars() {
  Rng rng(60);
  Eigen::Matrix3Xd ends(3, 12);
  for (Eigen::Index k = 0; k < 6; ++k) {
    const Eigen::Vector3d way = 0.6 * NormalVector(&rng).normalized();
    const Eigen::Vector3d middle = UniformVector(&rng, -0.2, 0.2);
    ends.col(2 * k) = middle - way;
    ends.col(2 * k + 1) = middle + way;
  }
  return Observe(TheStudy().truth, ends, 0.0, 0.05, rng);
}

std::string BarRefusal(const data::Rig& rig, const Observations& data, double length) {
  try {
    return CheckBar(rig, data, {length, 2e-5}, "bar.csv").verdict;
  } catch (const Error& error) {
    return error.what();
  }
}

TEST(BarSlips, ABarsLengthInAnotherUnit) {
  const Observations data = Bars();
  EXPECT_THAT(BarRefusal(TheRig(), data, 1200.0),
              HasSubstr("millimetres under the name of metres"));
  EXPECT_THAT(BarRefusal(TheRig(), data, 1.2 / 0.3048), HasSubstr("--bar 30ft"));
  EXPECT_THAT(BarRefusal(TheRig(), data, 1.2e-3),
              HasSubstr("metres under the name of millimetres"));
  // Of no unit: a wrong length, whatever it is, also where no place has ends so far apart.
  EXPECT_EQ(BarRefusal(TheRig(), data, 7.0), "no longer valid");
  EXPECT_EQ(BarRefusal(TheRig(), data, 200.0), "no longer valid");
}

// Too far off for readings that are linear in it about the stated length.
TEST(BarSlips, ABarsLengthThatIsFarOffIsTheCause) {
  const Observations data = Bars();
  for (const double length : {0.8, 1.08, 1.25, 1.32, 1.8}) {
    const CheckResult bad = CheckBar(TheRig(), data, {length, 2e-5}, "test");
    EXPECT_EQ(bad.verdict, "no longer valid") << length;
    ASSERT_EQ(bad.causes.size(), 1U) << length;
    EXPECT_EQ(bad.causes[0].kind, CauseKind::kFrame) << length;
    EXPECT_NEAR(bad.causes[0].size, 1.2 - length, 1e-3) << length;
  }
}

// A file that is written otherwise than it says speaks of itself, not of the rig.
TEST(BarSlips, SlipsInABarsReadings) {
  const Observations data = Bars();
  const auto changed = [&](const auto& change) {
    Observations out = data;
    for (Reading& r : out.readings) change(&r);
    std::stable_sort(out.readings.begin(), out.readings.end(),
                     [](const Reading& a, const Reading& b) {
                       return std::pair(a.point, a.camera) < std::pair(b.point, b.camera);
                     });
    return BarRefusal(TheRig(), out, 1.2);
  };
  EXPECT_EQ(changed([](Reading*) {}), "still valid");
  EXPECT_THAT(changed([](Reading* r) { r->point ^= r->camera == 1 ? 1 : 0; }),
              HasSubstr("has the bar's two ends exchanged"));
  EXPECT_THAT(changed([](Reading* r) { r->camera = r->camera < 2 ? 1 - r->camera : r->camera; }),
              HasSubstr("\" are exchanged"));
  EXPECT_THAT(changed([](Reading* r) { r->u_px = r->camera == 3 ? 2159.0 - r->u_px : r->u_px; }),
              HasSubstr("is read from its other end; write 2159 less the reading"));
  EXPECT_THAT(
      changed([](Reading* r) { r->point = r->point % 2 == 1 ? (r->point + 2) % 12 : r->point; }),
      HasSubstr("each second end is that of the placement before it"));
  // A camera that moved by a tenth of its row is none.
  EXPECT_EQ(changed([](Reading* r) { r->u_px += r->camera == 0 ? 216.0 : 0.0; }),
            "no longer valid");
}

}  // namespace
}  // namespace unfurl::calib::bar_slips_test
