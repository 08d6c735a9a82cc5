// Intervals of all parts, against their parts added by hand.
#include "correlate/fit/interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "correlate/fit/fit.h"

namespace unfurl::correlate::interval_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Parameter Plain() {
  Parameter p;
  p.name = "stiffness", p.start = 10.0, p.low = 0.0, p.high = 100.0;
  return p;
}

ParameterEstimate At(double value, double sigma_data, double sigma_model) {
  ParameterEstimate e;
  e.value = value, e.sigma_data = sigma_data, e.sigma_model = sigma_model;
  return e;
}

TEST(Interval, WithoutAProfileIsThatOfTheStandardErrors) {
  const ParameterEstimate e = At(10.0, 0.3, 0.4);
  const Interval data = IntervalOfData(Plain(), e), all = IntervalOfAllParts(Plain(), e);
  EXPECT_NEAR(data.low, 10.0 - 1.959964 * 0.3, 1e-6);
  EXPECT_NEAR(data.high, 10.0 + 1.959964 * 0.3, 1e-6);
  EXPECT_NEAR(all.low, 10.0 - 1.959964 * 0.5, 1e-6);  // 3, 4, 5
  EXPECT_NEAR(all.high, 10.0 + 1.959964 * 0.5, 1e-6);
}

TEST(Interval, EachHalfOfAProfileAddsTheModelsErrorInQuadrature) {
  ParameterEstimate e = At(10.0, 0.3, 4.0 / kHalf95);
  e.profile.points.resize(3);
  e.profile.low = 7.0, e.profile.high = 17.5;
  const Interval all = IntervalOfAllParts(Plain(), e);
  EXPECT_NEAR(all.low, 5.0, 1e-12);    // 3, 4, 5
  EXPECT_NEAR(all.high, 18.5, 1e-12);  // 7.5, 4, 8.5
}

// By the value, since that is what errors are propagated to; but never to 0: below half of the
// value along a hyperbola, so that an error of k values ends at 1 / (4 k) of it.
TEST(Interval, OfALogarithmStaysPositive) {
  Parameter p = Plain();
  p.log = true, p.low = 1e-9;
  const ParameterEstimate e = At(10.0, 3.0, 40.0);  // 400% of the value
  const Interval all = IntervalOfAllParts(p, e);
  const double half = kHalf95 * std::hypot(0.3, 4.0);  // of the value
  EXPECT_NEAR(all.low, 10.0 / (4.0 * half), 1e-12);
  EXPECT_NEAR(all.high, 10.0 * (1.0 + half), 1e-12);
  const Interval small = IntervalOfAllParts(p, At(10.0, 0.3, 0.4));
  EXPECT_NEAR(small.low, 10.0 - kHalf95 * 0.5, 1e-12);
  p.high = 50.0;
  EXPECT_EQ(IntervalOfAllParts(p, e).high, p.high);  // and ends at the bound
}

// Of what is a hundredth of its standard error. The model's error, a fiftieth of that, was added to
// the logarithm, in which it is twice the value: the interval ended thousands of times too far up.
TEST(Interval, OfNearlyNothingIsOfItsError) {
  Parameter p = Plain();
  p.log = true, p.low = 1e-9;
  ParameterEstimate e = At(0.01, 1.0, 0.02);
  e.profile.points.resize(3);
  e.profile.low = kNaN, e.profile.high = 1.97;
  const Interval all = IntervalOfAllParts(p, e);
  EXPECT_TRUE(std::isnan(all.low));
  EXPECT_NEAR(all.high, 0.01 + std::hypot(1.96, kHalf95 * 0.02), 1e-12);
}

TEST(Interval, AnOpenSideStaysOpenWhateverTheModel) {
  ParameterEstimate e = At(10.0, 0.3, 0.4);
  e.profile.points.resize(3);
  e.profile.low = 9.0, e.profile.high = kNaN;
  const Interval all = IntervalOfAllParts(Plain(), e);
  EXPECT_FALSE(all.Closed());
  EXPECT_TRUE(std::isfinite(all.low));
  EXPECT_TRUE(std::isnan(all.high));
}

// A value anywhere between the estimate and 100 standard errors above it: 1.645 beyond either end.
// Without that range it is the plain interval; in between, the two tails at either end hold 5%.
TEST(Interval, OfOneSideReachesAlongTheWay) {
  ParameterEstimate e = At(10.0, 0.3, 30.0);
  e.sigma_doubt = 0.4, e.model_shift = 50.0;
  const Interval wide = IntervalOfAllParts(Plain(), e, true);
  EXPECT_NEAR(wide.low, 10.0 - 1.644854 * 0.5, 1e-6);
  EXPECT_NEAR(wide.high, 60.0 + 1.644854 * 0.5, 1e-6);
  e.model_shift = -0.5;  // one standard error, to the other side
  const Interval one = IntervalOfAllParts(Plain(), e, true);
  const double c = (one.high - 10.0) / 0.5;
  EXPECT_NEAR(one.low, 9.5 - 0.5 * c, 1e-12);
  EXPECT_NEAR(0.5 * std::erfc(-(c + 1.0) / std::sqrt(2.0)) - 0.5 * std::erfc(c / std::sqrt(2.0)),
              0.95, 1e-9);
  e.model_shift = 0.0;
  EXPECT_NEAR(IntervalOfAllParts(Plain(), e, true).high, 10.0 + kHalf95 * 0.5, 1e-9);
}

}  // namespace
}  // namespace unfurl::correlate::interval_test
