#include "data/time_function.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "errors.h"

namespace unfurl::data::time_function_test {
namespace {

using ::testing::HasSubstr;

TEST(TimeFunction, NumbersAreConstant) {
  const TimeFunction f(2.5);
  EXPECT_TRUE(f.is_constant());
  EXPECT_EQ(f.Value(7.0), 2.5);
  EXPECT_EQ(f.At(7.0).rate, 0.0);
  const TimeValue v = f.Integral(1.0, 10.0).At(4.0);
  EXPECT_EQ(v.value, 11.0);
  EXPECT_EQ(v.rate, 2.5);
  EXPECT_EQ(v.acceleration, 0.0);
}

TEST(TimeFunction, StraightTablesGoThroughTheirPoints) {
  const TimeFunction f = TimeFunction::Table({1.0, 2.0, 4.0}, {0.0, 3.0, -1.0}, false, "here");
  EXPECT_EQ(f.Value(0.0), 0.0);
  EXPECT_EQ(f.Value(1.5), 1.5);
  EXPECT_EQ(f.At(1.5).rate, 3.0);
  EXPECT_EQ(f.Value(3.0), 1.0);
  EXPECT_EQ(f.At(3.0).rate, -2.0);
  // From the right at every point, as of step().
  EXPECT_EQ(f.At(1.0).rate, 3.0);
  EXPECT_EQ(f.At(2.0).rate, -2.0);
  EXPECT_EQ(f.At(4.0).rate, 0.0);
  EXPECT_EQ(f.Value(5.0), -1.0);
  EXPECT_EQ(f.At(5.0).rate, 0.0);
  // Areas of the trapezoids.
  const TimeFunction g = f.Integral(10.0, 5.0);
  EXPECT_NEAR(g.Value(0.0), 10.0, 1e-15);
  EXPECT_NEAR(g.Value(1.5), 10.0 + 0.375, 1e-14);
  EXPECT_NEAR(g.Value(4.0), 10.0 + 1.5 + 2.0, 1e-14);
  EXPECT_NEAR(g.Value(6.0), 10.0 + 3.5 - 2.0, 1e-14);
  EXPECT_EQ(g.At(3.0).rate, 1.0);
  EXPECT_EQ(g.At(3.0).acceleration, -2.0);
}

// By its definition: value, rate and acceleration go on across the points, and the acceleration
// vanishes at both ends.
TEST(TimeFunction, CubicTablesAreNaturalSplines) {
  const std::vector<double> t{0.0, 0.7, 1.1, 2.0, 3.5}, y{1.0, -0.5, 0.25, 2.0, 1.5};
  const TimeFunction f = TimeFunction::Table(t, y, true, "here");
  constexpr double kNear = 1e-9;  // s; times slopes of some tens, below kSmall
  constexpr double kSmall = 1e-7;
  for (std::size_t k = 0; k < t.size(); ++k) {
    EXPECT_NEAR(f.Value(t[k]), y[k], 1e-14);
    if (k == 0 || k + 1 == t.size()) continue;
    const TimeValue before = f.At(t[k] - kNear), after = f.At(t[k] + kNear);
    EXPECT_NEAR(before.value, after.value, kSmall);
    EXPECT_NEAR(before.rate, after.rate, kSmall);
    EXPECT_NEAR(before.acceleration, after.acceleration, kSmall);
  }
  EXPECT_NEAR(f.At(t.front() + kNear).acceleration, 0.0, kSmall);
  EXPECT_NEAR(f.At(t.back() - kNear).acceleration, 0.0, kSmall);
  // The integral's rate is the function, by differences across each piece.
  const TimeFunction g = f.Integral(0.0, 3.5);
  for (double at : {0.3, 0.9, 1.7, 3.0}) {
    const double h = 1e-4;
    EXPECT_NEAR((g.Value(at + h) - g.Value(at - h)) / (2 * h), f.Value(at), 1e-6);
    EXPECT_EQ(g.At(at).rate, f.Value(at));
  }
}

TEST(TimeFunction, TwoPointsMakeALineEitherWay) {
  const TimeFunction f = TimeFunction::Table({0.0, 2.0}, {1.0, 5.0}, true, "");
  EXPECT_NEAR(f.Value(0.5), 2.0, 1e-15);
  EXPECT_NEAR(f.At(0.5).rate, 2.0, 1e-15);
  EXPECT_NEAR(f.At(0.5).acceleration, 0.0, 1e-15);
}

TEST(TimeFunction, TablesThatAreNoneAreRefused) {
  const auto error = [](std::vector<double> t, std::vector<double> v) {
    return ErrorOf([&] { TimeFunction::Table(t, v, true, "s.toml:3:x"); });
  };
  EXPECT_THAT(error({1.0}, {1.0}), HasSubstr("s.toml:3:x: the table has less than two points"));
  EXPECT_THAT(error({0.0, 1.0}, {1.0}), HasSubstr("2 times and 1 values"));
  EXPECT_THAT(error({0.0, 0.0}, {1.0, 2.0}), HasSubstr("do not rise: 0 follows 0"));
  EXPECT_THAT(error({0.0, std::nan("")}, {1.0, 2.0}),
              HasSubstr("point 2 of the table is not finite"));
}

// Integrals that are known, over their range: to the accuracy that the header states.
TEST(TimeFunction, IntegralsOfExpressions) {
  struct Case {
    const char* text;
    double duration;
    double (*exact)(double);
    double range;
  };
  const Case cases[] = {
      {"cos(t)", 20.0, [](double t) { return std::sin(t); }, 2.0},
      {"exp(-3 * t)", 5.0, [](double t) { return (1 - std::exp(-3 * t)) / 3; }, 1.0 / 3},
      {"1 / (1 + (20 * (t - 1)) ^ 2)", 3.0,
       [](double t) { return (std::atan(20 * (t - 1)) + std::atan(20.0)) / 20; }, 0.15},
      {"t ^ 3 - 2 * t", 4.0, [](double t) { return t * t * t * t / 4 - t * t; }, 48.0},
      {"abs(t - 0.3)", 1.0,
       [](double t) { return (0.3 * 0.3 + (t - 0.3) * std::fabs(t - 0.3)) / 2; }, 0.29},
      {"step(t - 0.37)", 2.0, [](double t) { return t < 0.37 ? 0.0 : t - 0.37; }, 1.63},
      {"smoothstep(t / 2) * 6", 5.0,
       [](double t) {
         const double x = std::min(t / 2, 1.0), x4 = x * x * x * x;
         return 12 * x4 * (2.5 + x * (x - 3)) + (t > 2 ? 6 * (t - 2) : 0.0);
       },
       24.0},
  };
  constexpr double kAccuracy = 1e-12;
  for (const Case& k : cases) {
    const TimeFunction f = TimeFunction::Expression(k.text, "");
    const TimeFunction g = f.Integral(0.5, k.duration);
    for (int i = 0; i <= 1000; ++i) {
      const double t = k.duration * i / 1000;
      ASSERT_NEAR(g.Value(t), 0.5 + k.exact(t), kAccuracy * k.range + 2e-16)
          << k.text << " at " << t;
    }
    EXPECT_EQ(g.At(0.3).rate, f.Value(0.3));
    EXPECT_EQ(g.At(0.3).acceleration, f.At(0.3).rate);
    // A run may be asked to last longer than its scene.
    EXPECT_NEAR(g.Value(1.3 * k.duration), 0.5 + k.exact(1.3 * k.duration), 1e-6 * k.range)
        << k.text;
  }
}

// A pulse of a five-thousandth of the run, or far shorter, wherever it lies: its whole area,
// sqrt(pi) w.
TEST(TimeFunction, ShortPulsesAreIntegrated) {
  for (const double duration : {1.0, 10.0, 1000.0}) {
    for (const double part : {0.031, 0.28, 0.4999, 0.5312, 0.87}) {
      for (const double narrow : {2e-4, 1e-6, 1e-8}) {
        const double width = narrow * duration, at = part * duration;
        const TimeFunction f = TimeFunction::Expression(
            fmt::format("exp(-((t - {:.17g}) / {:.17g}) ^ 2) / {:.17g}", at, width, width),
            "s.toml:1:x");
        // A double of the time holds 1e-16 of the duration.
        const double accuracy = 1e-12 / (narrow < 1e-4 ? 1e4 * narrow : 1.0);
        EXPECT_NEAR(f.Integral(0.0, duration).Value(duration), std::sqrt(std::numbers::pi),
                    5e3 * accuracy)
            << part << " of " << duration << ", " << narrow;
      }
    }
  }
}

TEST(TimeFunction, IntegralsThatTakeTooLongAreRefused) {
  const TimeFunction f = TimeFunction::Expression("sin(1e6 * t)", "s.toml:3:x");
  EXPECT_THAT(ErrorOf([&] { f.Integral(0.0, 1e3); }),
              HasSubstr("s.toml:3:x: \"sin(1e6 * t)\" changes too fast"));
}

TEST(TimeFunction, FaultsAreToldWithTimeAndText) {
  const TimeFunction f = TimeFunction::Expression("1 / (t - 0.3)", "s.toml:3:x");
  EXPECT_EQ(ErrorOf([&] { f.CheckFinite(1.0, 0); }),
            "s.toml:3:x: \"1 / (t - 0.3)\" divides by zero at t = 0.3 s; change it, or end the run "
            "before");
  EXPECT_EQ(ErrorOf([&] { f.CheckFinite(0.2, 0); }), "no error");
  EXPECT_EQ(f.Describe(), "\"1 / (t - 0.3)\" (s.toml:3:x)");
  EXPECT_TRUE(f.IsFinite(0.2, 2));
  EXPECT_FALSE(TimeFunction::Expression("1 / t", "").IsFinite(0.0, 0));
}

}  // namespace
}  // namespace unfurl::data::time_function_test
