// Readings that are left out at the end of a camera's field: wrong, or of a lens that bends there.
#include "calib/outermost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "base/statistics.h"
#include "calib/calibrate.h"
#include "calib/covariance.h"
#include "calib/gross.h"
#include "calib/verdict.h"
#include "measure/camera_model.h"
#include "tests/calib/fixtures.h"
#include "tests/repeats.h"

namespace unfurl::calib::outermost_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::MakeRig;
using testing::Observe;
using testing::PointsInCube;

constexpr int kPoints = 120, kMiddle = kPoints - 2, kCorner = kPoints - 1;
constexpr int kCamera = 1;  // whose reading is wrong

// A survey whose last point lies beyond the others, in a corner, and the last but one amid them.
struct Room {
  std::vector<data::RigCamera> truth = MakeRig({}, Rng(31).Stream("rig"));
  Eigen::Matrix3Xd places = PointsInCube(kPoints, 0.7, Rng(31).Stream("places"));

  explicit Room(double corner) {
    places.col(kMiddle) = Eigen::Vector3d(0.05, -0.1, 0.02);
    places.col(kCorner) = Eigen::Vector3d::Constant(corner);
  }
  Observations Survey(std::uint64_t seed) const {
    return Observe(truth, places, 3e-4, 0.05, Rng(seed).Stream("noise"));
  }
  static std::size_t ReadingOf(const Observations& data, int point) {
    for (std::size_t k = 0; k < data.readings.size(); ++k) {
      if (data.readings[k].point == point && data.readings[k].camera == kCamera) return k;
    }
    ADD_FAILURE() << "camera " << kCamera << " does not see point " << point;
    return 0;
  }
};

Calibration Wrong(double corner, int point, double by_px) {
  const Room room(corner);
  Observations data = room.Survey(7);
  data.readings[Room::ReadingOf(data, point)].u_px += by_px;
  return Calibrate(data, {}, "test");
}

TEST(Outermost, AReadingThatNoOtherVouchesForIsSaid) {
  EXPECT_EQ(Wrong(0.75, kCorner, 0.0).rig.verdict, kGood);
  const Calibration corner = Wrong(0.75, kCorner, 18.0);
  EXPECT_EQ(corner.rig.verdict, kWithCare);
  EXPECT_THAT(corner.rig.reasons,
              Contains(AllOf(HasSubstr("camera \"c2\": the reading of point \"p120\""),
                             HasSubstr("no other that takes part is near it"))));
  const Calibration middle = Wrong(0.75, kMiddle, 18.0);
  EXPECT_EQ(middle.rig.verdict, kGood);
  EXPECT_THAT(middle.rig.reasons, Contains(HasSubstr("1 reading and 0 surveyed points")));
}

// Left in, a reading leads the lens where no others are near: the fit follows it, and only held out
// its point shows that. [leverage: Hoaglin and Welsch 1978]
TEST(Outermost, APointThatTheFitFollowsAloneIsSaid) {
  const Calibration found = Wrong(0.9, kCorner, 40.0);
  EXPECT_NE(found.rig.verdict, kGood);
  EXPECT_THAT(found.rig.reasons, Contains(HasSubstr("point \"p120\", held out, was found")));
}

// The variance of what the others make of a reading, by many surveys.
TEST(Outermost, VarianceOfWhatOthersMakeOfAReading) {
  const Room room(0.75);
  const RigFit fit = FitRig(room.Survey(1), {}, "test");
  const auto surveys = static_cast<std::uint64_t>(Repeats(15, 60));
  for (const int point : {kMiddle, kCorner}) {
    double sum = 0.0, n = 0.0, by_rig = 0.0;
    for (std::uint64_t seed = 1; seed <= surveys; ++seed) {
      const Observations data = room.Survey(seed);
      const std::size_t k = Room::ReadingOf(data, point);
      Weighting weighting = EqualWeighting(data, 0.0);
      weighting.use_reading.assign(data.readings.size(), 1);
      weighting.use_survey.assign(static_cast<std::size_t>(data.points()), 1);
      weighting.use_reading[k] = 0;
      const RefinedBundle bundle =
          Refine(data, fit.priors, weighting, {.choose_gross = false}, {room.truth, room.places});
      // By the point's other readings and its survey, were the cameras known exactly.
      std::size_t first = k;
      while (first > 0 && data.readings[first - 1].point == point) --first;
      unsigned use = 0;
      for (std::size_t m = first; m < data.readings.size() && data.readings[m].point == point;
           ++m) {
        if (m != k) use |= 1U << (m - first);
      }
      PointFit own;
      ASSERT_TRUE(FitPoint(data, bundle.weighting, bundle.state.cameras, first, use, true,
                           bundle.state.points.col(point), &own));
      measure::Projection h;
      ASSERT_TRUE(measure::Project(bundle.state.cameras[kCamera], own.p, &h));
      by_rig = bundle.redundancy.by_rig[k];
      const double known = (h.du_dp * own.cov * h.du_dp.transpose()).value() +
                           bundle.weighting.Variance(data.readings[k]);
      sum += std::pow(bundle.summary.residual_px[k], 2) / (known * (1.0 + by_rig));
      n += 1.0;
    }
    std::printf("point %d: %.2f by the rig, squared residuals over predicted %.2f\n", point, by_rig,
                sum / n);
    // Chi-square of as many degrees, chance of 1e-4 on either side.
    EXPECT_GT(sum, ChiSquareQuantile(1e-4, n));
    EXPECT_LT(sum, ChiSquareQuantile(1.0 - 1e-4, n));
    EXPECT_EQ(by_rig > 1.0, point == kCorner);
  }
}

}  // namespace
}  // namespace unfurl::calib::outermost_test
