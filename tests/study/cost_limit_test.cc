// Limits of sequences that are known in closed form.
#include "study/cost_limit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace unfurl::study::cost_limit_test {
namespace {

constexpr int kPoints = 200;

// q(t; h) = sin t + a h^2 cos 3t + b h^4 cos 5t, whose limit is sin t; h = 1, 1/2, 1/4, ..
std::vector<CostValues> Regular(double a, double b, int meshes) {
  std::vector<CostValues> out;
  for (int k = 0; k < meshes; ++k) {
    const double h = std::exp2(-k);
    CostValues values;
    for (int i = 0; i < kPoints; ++i) {
      const double t = 0.05 * i;
      values.a.push_back(std::sin(t) + a * h * h * std::cos(3 * t) +
                         b * std::pow(h, 4) * std::cos(5 * t));
    }
    out.push_back(values);
  }
  return out;
}

double ErrorOfLimit(const CostLimit& limit) {
  CostValues truth;
  for (int i = 0; i < kPoints; ++i) truth.a.push_back(std::sin(0.05 * i));
  return DistanceOf(limit.values, truth).rms;
}

const std::vector<double> kSizes = {1, 2, 4, 8};

TEST(CostLimit, RegularMeshesAreExtrapolatedAndTheErrorIsTold) {
  for (const double b : {0.0, 0.1, 0.5, -0.5, 1.0}) {
    const std::vector<CostValues> values = Regular(1.0, b, 3);
    const CostLimit limit = LimitOf(values, {1, 2, 4}, 2.0, true);
    EXPECT_TRUE(limit.extrapolated) << b;
    const double real = ErrorOfLimit(limit);
    EXPECT_LE(real, limit.error.rms + 1e-12) << b;
    // Rounding apart, better than the finest mesh itself.
    CostLimit raw;
    raw.values = values.back();
    EXPECT_LT(limit.error.rms, 0.7 * ErrorOfLimit(raw)) << b;
  }
}

TEST(CostLimit, AnotherOrderThanThatOfTheoryIsSeen) {
  // First order where the second is expected: E = q3 + (q3 - q2) / 3 is off by two thirds.
  for (const double order : {0.5, 1.0, 1.5, 3.0}) {
    std::vector<CostValues> values;
    for (int k = 0; k < 3; ++k) values.push_back({{5.0 + std::exp2(-order * k)}, {}});
    const CostLimit limit = LimitOf(values, {1, 2, 4}, 2.0, true);
    EXPECT_LE(std::fabs(limit.values.a[0] - 5.0), 1.0001 * limit.error.rms) << order;
    EXPECT_TRUE(std::isfinite(limit.error.rms));
  }
}

TEST(CostLimit, SmoothBeamsAreTakenAsTheyAreFromSizesThatDoNotDouble) {
  for (const double order : {1.0, 2.0, 3.0, 5.0}) {
    std::vector<CostValues> values;
    for (const double p : {4.0, 6.0, 8.0}) values.push_back({{2.0 + std::pow(p, -order)}, {}});
    const CostLimit limit = LimitOf(values, {4, 6, 8}, 3.0, false);
    EXPECT_FALSE(limit.extrapolated);
    EXPECT_LE(std::pow(8.0, -order), 1.0001 * limit.error.rms) << order;
    if (order <= 3.0) {
      EXPECT_NEAR(limit.error.rms, std::pow(8.0, -order), 1e-6);
    }
  }
}

TEST(CostLimit, WhatDoesNotSettleIsNotKnown) {
  std::vector<CostValues> values;
  for (const double q : {1.0, 2.0, 3.0}) values.push_back({{q}, {}});
  EXPECT_TRUE(std::isinf(LimitOf(values, {1, 2, 4}, 2.0, true).error.rms));
  EXPECT_TRUE(std::isinf(LimitOf({values[0]}, {1}, 2.0, true).error.rms));
  EXPECT_EQ(LimitOf({values[0], values[1]}, {1, 2}, 2.0, true).error.rms, 1.0);
  values[0] = {};  // a latch that does not close on the coarsest mesh
  EXPECT_TRUE(std::isinf(LimitOf(values, {1, 2, 4}, 2.0, true).error.rms));
}

TEST(CostLimit, WhatGoesToAndFroIsKnownToItsSwing) {
  // +-1 around 7, and the same that dies away.
  for (const double decay : {1.0, 0.9, 0.5}) {
    std::vector<CostValues> values;
    for (int k = 0; k < 3; ++k) values.push_back({{7.0 + std::pow(-decay, k)}, {}});
    const CostLimit limit = LimitOf(values, {1, 2, 4}, 2.0, true);
    EXPECT_GE(limit.error.rms, std::fabs(limit.values.a[0] - 7.0)) << decay;
    EXPECT_LE(limit.error.rms, 2.0);
    EXPECT_FALSE(limit.extrapolated);
  }
}

TEST(CostLimit, ALastDifferenceThatIsSmallByChanceIsNotBelieved) {
  // 1.1 and 1.1001 look as if they were there; from 1 to 1.1 the second order leaves 0.1 / 12.
  const std::vector<CostValues> values = {{{1.0}, {}}, {{1.1}, {}}, {{1.1001}, {}}};
  EXPECT_GE(LimitOf(values, {1, 2, 4}, 2.0, false).error.rms, 0.99 * 0.1 / 12.0);
}

TEST(CostLimit, TwoThatDisagreeAreKnownToWhatIsLeft) {
  CostLimit a, b;
  a.values = {{1.0}, {}};
  a.error = {0.01, 0.01};
  b.values = {{1.5}, {}};
  b.error = {0.1, 0.1};
  EXPECT_NEAR(Joined(a, b).error.rms, 0.4, 1e-12);
  EXPECT_EQ(Joined(b, a).values.a[0], 1.0);
  b.values = {{1.05}, {}};
  EXPECT_NEAR(Joined(a, b).error.rms, 0.01, 1e-12);
}

// The pin force of an unbent beam on which a moment is let go at once: 69 and 98 N of two meshes
// that double, 319 N of one of another kind; it has no limit at all.
TEST(CostLimit, TwoMeshesAreNotBelievedAgainstAThirdOfAnotherKind) {
  const std::vector<CostValues> doubled = {{{69.0}, {}}, {{98.0}, {}}, {{98.1}, {}}};
  const CostLimit two = LimitOf({doubled[0], doubled[1]}, {4, 8}, 2.0, true);
  const CostLimit one = LimitOf({{{319.0}, {}}}, {4}, 3.0, false);
  EXPECT_NEAR(two.error.rms, 29.0, 1e-12);
  EXPECT_NEAR(Joined(two, one).error.rms, 221.0, 1e-12);
  EXPECT_EQ(Joined(one, two).values.a[0], 98.0);
  const CostLimit three = LimitOf(doubled, {4, 8, 16}, 2.0, true);
  EXPECT_TRUE(three.settles);
  EXPECT_EQ(Joined(three, one).error.rms, three.error.rms);
}

TEST(CostValues, AStepThatComesLaterIsNoErrorFromEventToEvent) {
  constexpr double kStep = 0.01;
  const auto step = [&](double at) {
    std::vector<double> v;
    for (int i = 0; i <= 200; ++i) v.push_back(i * kStep < at ? -1.0 : 2.0);
    return v;
  };
  for (const double late : {0.8, 0.999, 1.003, 1.017, 1.3}) {
    const std::vector<double> moved =
        FromEventToEvent(step(late), kStep, {{"latch j 1", late}}, {{"latch j 1", 1.0}});
    EXPECT_EQ(DistanceOf({moved, {}}, {step(1.0), {}}).largest, 0.0) << late;
  }
  // Without events, or with others, it stays as it is.
  EXPECT_EQ(FromEventToEvent(step(0.8), kStep, {{"latch k 1", 0.8}}, {{"latch j 1", 1.0}}),
            step(0.8));
}

TEST(CostValues, ASmoothPartKeepsItsShape) {
  // f(t) = t until the event and 3 - t after it; the other's clock runs a tenth slower.
  constexpr double kStep = 0.01;
  std::vector<double> own;
  for (int i = 0; i <= 300; ++i) {
    const double t = i * kStep;
    own.push_back(t < 1.1 ? t / 1.1 : 3.0 - (t - 0.1));
  }
  const std::vector<double> moved = FromEventToEvent(own, kStep, {{"e", 1.1}}, {{"e", 1.0}});
  for (int i = 0; i < 280; ++i) {
    const double t = i * kStep;
    EXPECT_NEAR(moved[i], i <= 100 ? t : 3.0 - t, i == 100 ? 1.1 : 0.02) << t;
  }
}

TEST(CostValues, DistancesAreThoseInThePlane) {
  const CostValues p{{0.0, 3.0}, {0.0, 4.0}}, q{{0.0, 0.0}, {0.0, 0.0}};
  EXPECT_NEAR(DistanceOf(p, q).largest, 5.0, 1e-12);
  EXPECT_NEAR(DistanceOf(p, q).rms, std::sqrt(12.5), 1e-12);
  CostQuantity mark;
  mark.kind = CostQuantity::Kind::kMark;
  EXPECT_NEAR(ScaleOf(mark, p), 5.0, 1e-12);
  EXPECT_TRUE(std::isinf(DistanceOf(p, {}).rms));
}

}  // namespace
}  // namespace unfurl::study::cost_limit_test
