// A distance offset that several points share, against its closed forms.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "base/random.h"
#include "calib/explain.h"

namespace unfurl::calib::range_offset_test {
namespace {

using ::testing::HasSubstr;

constexpr double kSigma = 3e-4;  // of a shift's coordinate [m]
const Eigen::Vector3d kStation(4.0, -3.0, 0.5);

struct Shifts {
  Eigen::Matrix3Xd p, shift;
  std::vector<Eigen::Matrix3d> cov;
};

// n points about the origin; the first `members` shifted by `offset` along their lines to the
// station, the others as far across them.
Shifts Make(int n, int members, double offset) {
  Rng rng(5);
  Shifts s;
  s.p.resize(3, n);
  s.shift.resize(3, n);
  for (int i = 0; i < n; ++i) {
    s.p.col(i) << rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-1, 1);
    const Eigen::Vector3d r = (s.p.col(i) - kStation).normalized();
    const Eigen::Vector3d across = r.unitOrthogonal();
    s.shift.col(i) = offset * (i < members ? r : Eigen::Vector3d(i % 2 ? across : r.cross(across)));
    s.cov.push_back(kSigma * kSigma * Eigen::Matrix3d::Identity());
  }
  return s;
}

// With the station known the offset is the mean of the shifts along the lines, its sigma kSigma /
// sqrt(n).
TEST(RangeOffset, WithAKnownStationIsTheMeanAlongTheLines) {
  for (const double offset : {34.4e-3, -17.5e-3}) {
    Shifts s = Make(9, 6, offset);
    double mean = 0.0;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3d r = (s.p.col(i) - kStation).normalized();
      s.shift.col(i) += (i - 2) * 1e-4 * r + 2e-4 * r.unitOrthogonal();
      mean += s.shift.col(i).dot(r) / 6.0;
    }
    const RangeOffset found = FindRangeOffset(s.p, s.shift, s.cov, kStation);
    EXPECT_TRUE(found.found);
    EXPECT_THAT(found.members, ::testing::ElementsAre(0, 1, 2, 3, 4, 5));
    EXPECT_NEAR(found.offset, mean, 1e-12);
    EXPECT_NEAR(found.sigma, kSigma / std::sqrt(6.0), 1e-12);
    EXPECT_NEAR((found.station - kStation).norm(), 0.0, 1e-15);
  }
}

// What is across a line by less than four sigmas per coordinate belongs, more does not.
TEST(RangeOffset, MembersAreWithinTheGate) {
  for (const double sigmas : {3.9, 4.1}) {
    Shifts s = Make(6, 6, 20e-3);
    const Eigen::Vector3d r = (s.p.col(2) - kStation).normalized();
    s.shift.col(2) += sigmas * std::sqrt(3.0) * kSigma * r.unitOrthogonal();
    EXPECT_EQ(FindRangeOffset(s.p, s.shift, s.cov, kStation).members.size(),
              sigmas < 4.0 ? 6U : 5U);
  }
}

TEST(RangeOffset, FewPointsSayNothing) {
  for (const int members : {2, 3, 4, 5}) {
    const Shifts s = Make(members, members, 20e-3);
    EXPECT_EQ(FindRangeOffset(s.p, s.shift, s.cov, kStation).found, members >= 3) << members;
    const RangeOffset blind = FindRangeOffset(s.p, s.shift, s.cov, Eigen::Vector3d::Constant(NAN));
    EXPECT_EQ(blind.found, members >= 5) << members;
  }
}

// An offset that its own scatter explains is none.
TEST(RangeOffset, MustStandOutOfItsScatter) {
  for (const double sigmas : {3.9, 4.1}) {
    const Shifts s = Make(25, 25, sigmas * kSigma / 5.0);
    EXPECT_EQ(FindRangeOffset(s.p, s.shift, s.cov, kStation).found, sigmas > 4.0);
  }
}

// Without the station it comes out of the lines' meeting, either sign of the offset.
TEST(RangeOffset, FindsTheStation) {
  for (const double offset : {34.4e-3, -34.4e-3}) {
    const Shifts s = Make(14, 9, offset);
    const RangeOffset found = FindRangeOffset(s.p, s.shift, s.cov, Eigen::Vector3d::Constant(NAN));
    ASSERT_TRUE(found.found);
    EXPECT_EQ(found.members.size(), 9U);
    EXPECT_NEAR(found.offset, offset, 1e-6);
    // The weak prior of 100 m on the station's step moves it by far less than a centimetre.
    EXPECT_LT((found.station - kStation).norm(), 1e-2);
    EXPECT_GT(found.sigma, kSigma / 3.0);  // the station is paid for
    EXPECT_LT(found.sigma, 3.0 * kSigma / 3.0);
  }
}

// A difference of two prisms' constants is named within four sigmas, and never beyond half a
// millimetre.
TEST(PrismsThatDiffer, WithinItsErrorAndHalfAMillimetre) {
  RangeOffset found;
  const auto named = [&](double offset, double sigma) {
    found.offset = offset;
    found.sigma = sigma;
    return PrismsThatDiffer(found);
  };
  EXPECT_THAT(named(34.4e-3 + 0.39e-3, 0.1e-3), HasSubstr("34.4 mm"));
  EXPECT_THAT(named(-34.4e-3 + 0.39e-3, 0.1e-3), HasSubstr("34.4 mm"));
  EXPECT_EQ(named(34.4e-3 + 0.41e-3, 0.1e-3), "");
  EXPECT_THAT(named(23.1e-3 + 0.49e-3, 1e-3), HasSubstr("360-degree"));
  EXPECT_EQ(named(23.1e-3 - 0.51e-3, 1e-3), "");
  EXPECT_THAT(named(17.2e-3, 0.1e-3), HasSubstr("mini prism"));
  EXPECT_EQ(named(5e-3, 1e-3), "");
}

}  // namespace
}  // namespace unfurl::calib::range_offset_test
