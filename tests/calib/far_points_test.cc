// Slips of metres in single coordinates: whatever their size and axis, the calibration is that of
// the rest, and the point and the coordinate are named.
#include "calib/far_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ostream>

#include "calib/calibrate.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::far_points_test {
namespace {

using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const GrossFinding* FindingOf(const Calibration& c, int point) {
  for (const GrossFinding& one : c.report.gross) {
    if (one.points == std::vector<int>{point} && one.camera < 0) return &one;
  }
  return nullptr;
}

struct Slip {
  double size;
  Eigen::Index axis;
};

void PrintTo(const Slip& slip, std::ostream* out) {
  *out << "xyz"[slip.axis] << " by " << slip.size;
}

class FarPointsOf : public ::testing::TestWithParam<Slip> {};

TEST_P(FarPointsOf, ASlipOfAnySizeIsNamed) {
  static const testing::Study study = testing::MakeStudy(11, 150);
  static const Calibration clean = Calibrate(study.data, {}, "clean");
  const auto [size, axis] = GetParam();
  Observations data = study.data;
  data.p(axis, 10) += size;
  const Calibration found = Calibrate(data, {}, "slip");
  EXPECT_EQ(found.rig.verdict, clean.rig.verdict);
  for (std::size_t j = 0; j < clean.rig.cameras.size(); ++j) {
    // All but one of 150 points.
    EXPECT_LT((found.rig.cameras[j].p_WC - clean.rig.cameras[j].p_WC).norm(), 5e-3);
  }
  const GrossFinding* named = FindingOf(found, 10);
  ASSERT_NE(named, nullptr);
  EXPECT_EQ(named->kind, GrossKind::kAlongOneAxis);
  EXPECT_NEAR(named->size, std::fabs(size), 0.01 + 1e-6 * std::fabs(size));
  EXPECT_THAT(named->text, HasSubstr(std::string(1, "xyz"[axis]) + " alone is off"));
  EXPECT_LT((found.rig.volume_high - found.rig.volume_low).norm(), 4.0);
}
INSTANTIATE_TEST_SUITE_P(Sizes, FarPointsOf,
                         ::testing::Values(Slip{0.5, 0}, Slip{-25.0, 2}, Slip{5e3, 1},
                                           Slip{1e300, 0}));
INSTANTIATE_TEST_SUITE_P(MoreSizes, FarPointsOf,
                         ::testing::Values(Slip{2.0, 1}, Slip{-3.0, 2}, Slip{5.0, 0}, Slip{10.0, 1},
                                           Slip{100.0, 0}, Slip{-3e5, 2}));

// Points that few others are near, but where the cameras see them: they stay.
TEST(FarPoints, ThatAreRightTakePart) {
  const Rng rng(3);
  const auto truth = testing::MakeRig({}, rng.Stream("rig"));
  Eigen::Matrix3Xd points = testing::PointsInCube(150, 0.22, rng.Stream("points"));
  points.col(4) = Eigen::Vector3d(0.9, -0.7, 0.5);
  const Observations data = testing::Observe(truth, points, 3e-4, 0.05, rng.Stream("noise"));
  EXPECT_THAT(FarPoints(data.p), ElementsAre(4));
  const Calibration found = Calibrate(data, {}, "spread");
  EXPECT_THAT(found.report.far, IsEmpty());
  EXPECT_EQ(FindingOf(found, 4), nullptr);
  EXPECT_GT(found.rig.volume_high.x(), 0.89);
}

// Where many are, nothing is a blunder for being there.
TEST(FarPoints, AreNoneOfManyAndNoneOfAFullBox) {
  Eigen::Matrix3Xd p = testing::PointsInCube(100, 1.0, Rng(5));
  EXPECT_THAT(FarPoints(p), IsEmpty());
  p.leftCols(15).array() += 20.0;
  EXPECT_THAT(FarPoints(p), IsEmpty());
  EXPECT_THAT(FarPoints(Eigen::Matrix3Xd(3, 0)), IsEmpty());
}

}  // namespace
}  // namespace unfurl::calib::far_points_test
