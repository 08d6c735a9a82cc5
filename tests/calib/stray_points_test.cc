#include "calib/stray_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/error.h"
#include "base/random.h"

namespace unfurl::calib::stray_points_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Observations Box(int n, const Eigen::Vector3d& half) {
  Rng rng(1);
  Observations data;
  data.p.resize(3, n);
  for (int i = 0; i < n; ++i) {
    data.ids.push_back("p" + std::to_string(i));
    for (int k = 0; k < 3; ++k) data.p(k, i) = half(k) * (2.0 * rng.Uniform() - 1.0);
  }
  return data;
}

std::string Refusal(const Observations& data) {
  try {
    RefuseStray(data, "survey.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(RefuseStray, AWrongCoordinateIsNamedAtAnySize) {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    for (const double x : {20.0, 200.0, 5000.0, 1e290}) {
      Observations data = Box(60, scale * Eigen::Vector3d::Ones());
      data.p(0, 7) = scale * x;
      EXPECT_THAT(Refusal(data), AllOf(HasSubstr("point \"p7\" lies"), HasSubstr("survey.csv"),
                                       Not(HasSubstr("nan"))));
    }
  }
}

TEST(RefuseStray, SoAreTwo) {
  Observations data = Box(60, Eigen::Vector3d::Ones());
  data.p(0, 7) = 1e300;
  data.p(1, 9) = -1e200;
  EXPECT_THAT(Refusal(data), HasSubstr("point \"p7\", \"p9\" lies"));
}

TEST(RefuseStray, UnevenSurveysAreSound) {
  EXPECT_EQ(Refusal(Box(60, {30.0, 0.5, 0.5})), "");
  EXPECT_EQ(Refusal(Box(8, Eigen::Vector3d::Ones())), "");
  Observations frame = Box(60, 0.15 * Eigen::Vector3d::Ones());
  for (int i = 50; i < 60; ++i) frame.p.col(i) *= 20.0;  // a core, and some all around it
  EXPECT_EQ(Refusal(frame), "");
  Observations displaced = Box(60, Eigen::Vector3d::Ones());
  displaced.p(0, 7) += 3.0;  // what is judged by what cameras read of it
  EXPECT_EQ(Refusal(displaced), "");
}

}  // namespace
}  // namespace unfurl::calib::stray_points_test
