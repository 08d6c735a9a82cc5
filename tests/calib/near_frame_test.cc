// Surveys in a grid whose origin is far away: the calibration is that of the same survey about its
// own middle, moved, to what doubles keep of such coordinates.
#include "calib/near_frame.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/calib/fixtures.h"

namespace unfurl::calib::near_frame_test {
namespace {

using testing::MakeStudy;

Observations Moved(Observations data, const Eigen::Vector3d& by) {
  data.p.colwise() += by;
  for (SetUp& set_up : data.set_ups) set_up.middle += by;
  return data;
}

class NearFrame : public ::testing::TestWithParam<Eigen::Vector3d> {};

TEST_P(NearFrame, ACalibrationMovesWithItsSurvey) {
  // Coordinates of which nothing is rounded when they are moved.
  Observations data = MakeStudy(6, 100).data;
  data.p = (data.p.array() * 0x1p20).round() / 0x1p20;
  const Eigen::Vector3d by = GetParam();
  const Calibration here = Calibrate(data, {}, "here"), there = Calibrate(Moved(data, by), {}, "x");
  EXPECT_EQ(there.rig.verdict, here.rig.verdict);
  EXPECT_EQ(there.rig.reasons, here.rig.reasons);
  EXPECT_EQ(there.report.gross.size(), here.report.gross.size());
  EXPECT_NEAR(there.report.chi_square, here.report.chi_square, 1e-3 * here.report.chi_square);
  const double kept = 1e-7 + 1e-15 * by.norm();  // [m]
  for (std::size_t j = 0; j < here.rig.cameras.size(); ++j) {
    const data::RigCamera &a = here.rig.cameras[j], &b = there.rig.cameras[j];
    EXPECT_LT((b.p_WC - by - a.p_WC).norm(), 1e3 * kept) << j;
    EXPECT_NEAR(b.f_px, a.f_px, 1e-2);
  }
  EXPECT_LT((there.rig.volume_low - by - here.rig.volume_low).norm(), kept);
  EXPECT_LT((there.rig.covariance - here.rig.covariance).norm(), 1e-3 * here.rig.covariance.norm());
}
INSTANTIATE_TEST_SUITE_P(Grids, NearFrame,
                         ::testing::Values(Eigen::Vector3d(0.0, 5000.0, 0.0),
                                           Eigen::Vector3d(540000.0, 5400000.0, 500.0),
                                           Eigen::Vector3d(-3e6, 4e6, 3.5e6)));

TEST(NearOrigin, IsZeroWhereRoomsAre) {
  Eigen::Matrix3Xd p = Eigen::Matrix3Xd::Random(3, 50);
  EXPECT_TRUE(NearOrigin(p).isZero(0.0));
  p.col(7) = Eigen::Vector3d(1e6, -1e6, 0.0);  // a blunder of the survey moves nothing
  EXPECT_TRUE(NearOrigin(p).isZero(0.0));
  p *= 1e-3;
  EXPECT_TRUE(NearOrigin(p).isZero(0.0));
  p.colwise() += Eigen::Vector3d(0.0, 1.0, 0.0);  // a metre away from a millimetre's things
  EXPECT_FALSE(NearOrigin(p).isZero(0.0));
  EXPECT_LT((NearOrigin(p) - Eigen::Vector3d(0.0, 1.0, 0.0)).norm(), 2e-3);
}

// The rig of a fit alone, with what belongs to it.
TEST(NearOrigin, AFitMovesBackAsAWhole) {
  const Eigen::Vector3d by(0.0, 5400000.0, 0.0);
  const Observations data = MakeStudy(6, 100).data;
  const RigFit here = FitRig(data, {}, "test"), there = FitRig(Moved(data, by), {}, "test");
  const BundleState &a = here.bundle.state, &b = there.bundle.state;
  EXPECT_LT(((b.points.colwise() - by) - a.points).cwiseAbs().maxCoeff(), 1e-5);
  for (std::size_t j = 0; j < a.cameras.size(); ++j) {
    EXPECT_LT((b.cameras[j].p_WC - there.rig.cameras[j].p_WC).norm(), 1e-9);
    EXPECT_NEAR(there.priors[j].along - there.priors[j].axis.dot(by), here.priors[j].along, 1e-5);
  }
}

}  // namespace
}  // namespace unfurl::calib::near_frame_test
