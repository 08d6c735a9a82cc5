#include "calib/wand_triple.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/dense.h"
#include "base/pose.h"
#include "measure/camera_model.h"
#include "tests/calib/fixtures.h"

namespace unfurl::calib::wand_triple_test {
namespace {

using testing::MakeRig;

// Pinholes without noise: three cameras and bars alone give the views back, but for a motion and a
// mirror.
TEST(WandTriple, FindsThreePinholesFromBars) {
  const auto rig = MakeRig({.cameras = 4, .pose_error = 0.1, .distortion = 0.0}, Rng(5));
  Rng rng(7);
  Eigen::Matrix3Xd from(3, 60), to(3, 60), a(3, 60), b(3, 60);
  for (Eigen::Index k = 0; k < from.cols(); ++k) {
    for (;;) {
      Eigen::Vector3d middle, direction;
      for (int i = 0; i < 3; ++i) {
        middle(i) = rng.Uniform(-0.8, 0.8);
        direction(i) = rng.Normal();
      }
      direction.normalize();
      a.col(k) = middle - 0.4 * direction;
      b.col(k) = middle + 0.4 * direction;
      bool seen = true;
      for (int j = 0; j < 3; ++j) {
        double u = 0.0, v = 0.0;
        seen = seen && measure::Project(rig[static_cast<std::size_t>(j)], a.col(k), &u) &&
               measure::Project(rig[static_cast<std::size_t>(j)], b.col(k), &v);
        from(j, k) = (u - 1079.5) / 2160.0;
        to(j, k) = (v - 1079.5) / 2160.0;
      }
      if (seen) break;
    }
  }
  const std::vector<TriplePinholes> found = FitTriple({from, to}, 24, 3, {}, Rng(1));
  ASSERT_FALSE(found.empty());
  // The weak priors pull by a few thousandths.
  Eigen::Matrix3Xd truth(3, 120), marks(3, 120);
  for (Eigen::Index k = 0; k < 60; ++k) {
    Eigen::Vector3d p;
    ASSERT_TRUE(found[0].Find(from.col(k), &p));
    marks.col(2 * k) = 0.8 * p;
    ASSERT_TRUE(found[0].Find(to.col(k), &p));
    marks.col(2 * k + 1) = 0.8 * p;
    truth.col(2 * k) = a.col(k);
    truth.col(2 * k + 1) = b.col(k);
  }
  EXPECT_LT(std::min(FitRigid(truth, marks).rms, FitRigid(truth, -marks).rms), 0.02);
}

}  // namespace
}  // namespace unfurl::calib::wand_triple_test
