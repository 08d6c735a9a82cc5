#include "data/function_scan.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "base/random.h"
#include "data/expression.h"
#include "data/interval_series.h"
#include "data/time_function.h"

namespace unfurl::data::function_scan_test {
namespace {

// Values and derivatives of every function, at random times of random stretches, lie within the
// bounds; derivatives against those of TimeValue, which are exact.
TEST(IntervalSeries, HoldsValuesAndDerivatives) {
  const char* kTexts[] = {"sin(3 * t)",
                          "cos(t) * tan(t / 9)",
                          "asin(t / 5) + acos(t / 6) + atan(t - 2)",
                          "sinh(t) - cosh(t - 1)",
                          "tanh(t - 2)",
                          "exp(-(t - 2)^2)",
                          "log(1 + t) / sqrt(0.5 + t)",
                          "abs(t - 2)",
                          "step(sin(t)) * t",
                          "ramp(t - 1) - ramp(2 - t)",
                          "smoothstep(t / 3 - 0.2)",
                          "min(t, 3 - t) + max(t^2, 2)",
                          "(t - 2)^3 - (t - 2)^-2 * 0",
                          "t^1.5",
                          "2^(t - 1)",
                          "(t + 1)^-2",
                          "(1 + t)^t",
                          "-t / (1 + t^2)"};
  // Bounds are not rounded outwards.
  constexpr double kRounding = 1e-12;
  Rng rng(11);
  for (const char* text : kTexts) {
    const Expression f(text, "here");
    for (int k = 0; k < 200; ++k) {
      const double a = 4.0 * rng.Uniform(), b = a + std::pow(10.0, -4.0 * rng.Uniform());
      const IntervalSeries bounds = f.Bound(a, b, 2);
      for (int j = 0; j < 10; ++j) {
        const double t = a + (b - a) * rng.Uniform();
        const TimeValue v = f.At(t);
        const std::array<double, 3> values = {v.value, v.rate, 0.5 * v.acceleration};
        for (std::size_t d = 0; d < values.size(); ++d) {
          if (!std::isfinite(values[d])) continue;
          const double slack = kRounding * (1.0 + std::fabs(values[d]));
          EXPECT_GE(values[d], bounds.c[d].low - slack) << text << " at " << t << ", " << d;
          EXPECT_LE(values[d], bounds.c[d].high + slack) << text << " at " << t << ", " << d;
        }
      }
    }
  }
}

// Taylor's coefficients of higher order on a stretch of no length, against closed forms.
TEST(IntervalSeries, HigherDerivativesAreTaylors) {
  const double x = 0.3;
  const struct {
    const char* text;
    double c5;  // f^(5)(x) / 5!
  } kCases[] = {{"sin(t)", std::cos(x) / 120.0},
                {"exp(2 * t)", 32.0 * std::exp(2.0 * x) / 120.0},
                {"log(t)", 1.0 / (5.0 * std::pow(x, 5))},
                {"1 / t", -std::pow(x, -6)},
                {"t^6", 6.0 * x},
                {"t^0.5", 0.5 * 0.5 * 1.5 * 2.5 * 3.5 / 120.0 * std::pow(x, -4.5)},
                {"sqrt(t)", 0.5 * 0.5 * 1.5 * 2.5 * 3.5 / 120.0 * std::pow(x, -4.5)}};
  for (const auto& k : kCases) {
    const Interval c5 = Expression(k.text, "here").Bound(x, x, 5).c[5];
    EXPECT_NEAR(c5.low, k.c5, 1e-10 * std::fabs(k.c5)) << k.text;
    EXPECT_NEAR(c5.high, k.c5, 1e-10 * std::fabs(k.c5)) << k.text;
  }
}

// Wherever a bell lies and however narrow it is, the cells find it: their area is sqrt(pi) w.
TEST(FunctionScan, FindsBells) {
  constexpr double kPart = 1e-6, kArea = 0.05;  // the area is a sum of middles
  for (const double width : {1e-2, 1e-4, 1e-7, 1e-9}) {
    for (const double at : {0.031, 1.0, std::numbers::pi, 9.9}) {
      const TimeFunction f = TimeFunction::Expression(
          fmt::format("exp(-((t - {:.17g}) / {:.17g})^2)", at, width), "here");
      const FunctionScan scan = f.Scan(0, 10.0, kPart, 1 << 15);
      const double area = std::sqrt(std::numbers::pi) * width;
      EXPECT_NEAR(scan.area, area, kArea * area) << width << " at " << at;
      EXPECT_LE(scan.hidden, kPart * scan.area);
      EXPECT_NEAR(scan.high, 1.0, 0.05);
      EXPECT_LT(scan.cells.size(), 1000U);
      EXPECT_EQ(scan.cells.front().begin, 0.0);
      EXPECT_EQ(scan.cells.back().end, 10.0);
    }
  }
}

TEST(FunctionScan, SaysWhatItCannotFind) {
  // 1e6 periods: more than there may be cells.
  const TimeFunction f = TimeFunction::Expression("sin(2e6 * pi * t) * 1e-3 + t - 0.5", "here");
  const FunctionScan scan = f.Scan(0, 1.0, 1e-6, 1000);
  EXPECT_EQ(scan.cells.size(), 1000U);
  EXPECT_GT(scan.hidden, 1e-6 * scan.area);
  // Tables and constants hide nothing.
  EXPECT_TRUE(
      TimeFunction::Table({0.0, 1.0}, {0.0, 1.0}, true, "").Scan(0, 1.0, 1e-6, 9).cells.empty());
  EXPECT_TRUE(TimeFunction(2.0).Scan(0, 1.0, 1e-6, 9).cells.empty());
}

// Two crossings of one level, a nanosecond apart.
TEST(Edges, OfArgumentsThatAreNotLinear) {
  const Expression f("step(exp(-((t - 2.71) / 1e-9)^2) - 0.5)", "here");
  const std::vector<double> edges = f.Edges(10.0);
  ASSERT_EQ(edges.size(), 2U);
  const double half = 1e-9 * std::sqrt(std::log(2.0));
  // To the doubles of the time, of 4e-16.
  EXPECT_NEAR(edges[0], 2.71 - half, 1e-14);
  EXPECT_NEAR(edges[1], 2.71 + half, 1e-14);
}

// A divisor of 1 beside one of 1e200 is not zero.
TEST(TimeFunction, SteepDivisorsAreNoPoles) {
  const TimeFunction f = TimeFunction::Expression("1 / cosh((t - 2.2) / 0.005)", "here");
  EXPECT_NO_THROW(f.CheckFinite(3.0, 0));
  EXPECT_ANY_THROW(TimeFunction::Expression("1 / (t - 2.2)^2", "here").CheckFinite(10.0, 0));
}

}  // namespace
}  // namespace unfurl::data::function_scan_test
