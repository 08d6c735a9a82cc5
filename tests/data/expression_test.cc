#include "data/expression.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "errors.h"

namespace unfurl::data::expression_test {
namespace {

using ::testing::HasSubstr;

double At(const std::string& text, double t = 0.0) { return Expression(text, "here").Value(t); }

TEST(Expression, PrecedenceIsThatOfMathematics) {
  EXPECT_EQ(At("1 + 2 * 3"), 7.0);
  EXPECT_EQ(At("-2 ^ 2"), -4.0);
  EXPECT_EQ(At("2 ^ 3 ^ 2"), 512.0);
  EXPECT_EQ(At("2 ^ -1"), 0.5);
  EXPECT_EQ(At("8 / 4 / 2"), 1.0);
  EXPECT_EQ(At("7 - 4 - 2"), 1.0);
  EXPECT_EQ(At("2 * -3 + --1"), -5.0);
  EXPECT_EQ(At("(1 + 2) * 3e-1"), 3.0 * 3e-1);
  EXPECT_EQ(At(" .5\t*\n2. "), 1.0);
  EXPECT_EQ(At("cos(pi) + log(e)"), 0.0);
  EXPECT_EQ(At("min(3, t) + max(3, t)", 5.0), 8.0);
  EXPECT_EQ(At("step(t - 1)", 1.0), 1.0);
  EXPECT_EQ(At("step(t - 1)", 0.999), 0.0);
  EXPECT_EQ(At("ramp(t - 1)", 3.5), 2.5);
  EXPECT_EQ(At("smoothstep(t)", 0.5), 0.5);
}

TEST(Expression, ConstantPartsAreKnown) {
  EXPECT_TRUE(Expression("2 * pi / 3", "").is_constant());
  EXPECT_FALSE(Expression("0 * t", "").is_constant());
}

// Against the derivatives as mathematics has them.
TEST(Expression, DerivativesAreExact) {
  struct Case {
    const char* text;
    double t;
    // f, f', f'' in closed form.
    double f, f1, f2;
  };
  const double x = 0.37, s = std::sin(x), c = std::cos(x), e = std::exp(x);
  const double q = 1 + x * x, th = std::tanh(x), ta = std::tan(x), r = std::sqrt(1 - x * x);
  const Case cases[] = {
      {"sin(t)", x, s, c, -s},
      {"cos(t)", x, c, -s, -c},
      {"tan(t)", x, ta, 1 / (c * c), 2 * ta / (c * c)},
      {"asin(t)", x, std::asin(x), 1 / r, x / (r * r * r)},
      {"acos(t)", x, std::acos(x), -1 / r, -x / (r * r * r)},
      {"atan(t)", x, std::atan(x), 1 / q, -2 * x / (q * q)},
      {"sinh(t)", x, std::sinh(x), std::cosh(x), std::sinh(x)},
      {"cosh(t)", x, std::cosh(x), std::sinh(x), std::cosh(x)},
      {"tanh(t)", x, th, 1 - th * th, -2 * th * (1 - th * th)},
      {"exp(t)", x, e, e, e},
      {"log(t)", x, std::log(x), 1 / x, -1 / (x * x)},
      {"sqrt(t)", x, std::sqrt(x), 0.5 / std::sqrt(x), -0.25 / (x * std::sqrt(x))},
      {"abs(-t)", x, x, 1, 0},
      {"ramp(2 * t)", x, 2 * x, 2, 0},
      {"step(t)", x, 1, 0, 0},
      {"smoothstep(t)", x, x * x * x * (10 - 15 * x + 6 * x * x), 30 * x * x * (1 - x) * (1 - x),
       60 * x * (1 - x) * (1 - 2 * x)},
      {"t ^ 3", x, x * x * x, 3 * x * x, 6 * x},
      {"t ^ 2", 0.0, 0, 0, 2},
      {"t ^ 1", 0.0, 0, 1, 0},
      {"t ^ 0.5", x, std::sqrt(x), 0.5 / std::sqrt(x), -0.25 / (x * std::sqrt(x))},
      {"2 ^ t", x, std::pow(2, x), std::log(2) * std::pow(2, x),
       std::log(2) * std::log(2) * std::pow(2, x)},
      {"t / (1 + t ^ 2)", x, x / q, (1 - x * x) / (q * q), 2 * x * (x * x - 3) / (q * q * q)},
      {"exp(t) * sin(2 * t)", x, e * std::sin(2 * x), e * (std::sin(2 * x) + 2 * std::cos(2 * x)),
       e * (-3 * std::sin(2 * x) + 4 * std::cos(2 * x))},
      {"max(t, 1 - t)", x, 1 - x, -1, 0},
      {"min(t, 1 - t)", x, x, 1, 0},
  };
  constexpr double kRounding = 2e-15;  // a few operations
  for (const Case& k : cases) {
    const TimeValue v = Expression(k.text, "").At(k.t);
    EXPECT_NEAR(v.value, k.f, kRounding * (1 + std::fabs(k.f))) << k.text;
    EXPECT_NEAR(v.rate, k.f1, kRounding * (1 + std::fabs(k.f1))) << k.text;
    EXPECT_NEAR(v.acceleration, k.f2, 4 * kRounding * (1 + std::fabs(k.f2))) << k.text;
    EXPECT_EQ(v.value, Expression(k.text, "").Value(k.t)) << k.text;
  }
}

// t^t by the general power: (t^t)' = t^t (1 + log t), (t^t)'' = t^t ((1 + log t)^2 + 1/t).
TEST(Expression, PowersOfTimeToTime) {
  const double t = 1.7, f = std::pow(t, t), l = 1 + std::log(t);
  const TimeValue v = Expression("t ^ t", "").At(t);
  EXPECT_NEAR(v.rate, f * l, 1e-14);
  EXPECT_NEAR(v.acceleration, f * (l * l + 1 / t), 1e-14);
}

TEST(Expression, MistakesNameTheirColumn) {
  const auto error = [](const std::string& text) {
    return ErrorOf([&] { Expression(text, "s.toml:3:x"); });
  };
  EXPECT_EQ(error("0.3 * sim(t)"),
            "s.toml:3:x: column 7 of \"0.3 * sim(t)\": 'sim' is not known; did you mean 'sin'?");
  EXPECT_THAT(error(""), HasSubstr("empty"));
  EXPECT_THAT(error("2 t"), HasSubstr("column 3 of \"2 t\": 't' where an operator is needed"));
  EXPECT_THAT(error("(1 + t"), HasSubstr("the '(' of column 1 is not closed"));
  EXPECT_THAT(error("1 + t)"), HasSubstr("column 6"));
  EXPECT_THAT(error("1 +"), HasSubstr("ends too early"));
  EXPECT_THAT(error("1 + * 2"), HasSubstr("column 5"));
  EXPECT_THAT(error("t ** 2"), HasSubstr("write ^"));
  EXPECT_THAT(error("sin t"), HasSubstr("write sin(x)"));
  EXPECT_THAT(error("sin(t, 1)"), HasSubstr("takes one argument"));
  EXPECT_THAT(error("min(t)"), HasSubstr("write min(a, b)"));
  EXPECT_THAT(error("1e999"), HasSubstr("cannot be read"));
  EXPECT_THAT(error("x + 1"), HasSubstr("'x' is not known"));
  EXPECT_THAT(error("nan"), HasSubstr("'nan' is not known"));
  EXPECT_THAT(error(std::string(20000, '1')), HasSubstr("20000 characters"));
  EXPECT_THAT(error(std::string(3000, '(') + "t"), HasSubstr("nested too deeply"));
  std::string deep = "t";
  for (int k = 0; k < 100; ++k) deep = "t - (" + deep + ")";
  EXPECT_THAT(error(deep), HasSubstr("write fewer nested parentheses"));
  EXPECT_EQ(error(std::string(5000, '-') + "t"), "no error");
}

struct FaultCase {
  const char* text;
  double t;
  const char* reason;
};

TEST(Expression, FindsWhereItIsNotFinite) {
  const FaultCase cases[] = {
      {"1 / t", 0.0, "divides by zero"},
      {"1 / 0", 0.0, "divides by zero"},
      {"1 / (t - 0.3)", 0.3, "divides by zero"},      // between the points looked at
      {"1 / (t - 0.3) ^ 2", 0.3, "divides by zero"},  // without a change of sign
      {"1 / (2 - cos(t) - 1)", 0.0, "divides by zero"},
      {"tan(t)", std::numbers::pi / 2, "divides by zero"},
      {"(t - 1.1) ^ -1", 1.1, "divides by zero"},
      {"sqrt(1.234 - t)", 1.234, "square root of a negative"},
      {"log(0.7 - t)", 0.7, "logarithm"},
      {"asin(t)", 1.0, "inverse sine"},
      {"(0.5 - t) ^ 0.5", 0.5, "broken power"},
      {"max(sqrt(1.234 - t), 0)", 1.234, "square root of a negative"},  // on either side
      {"max(0, sqrt(1.234 - t))", 1.234, "square root of a negative"},
      {"min(0, sqrt(1.234 - t))", 1.234, "square root of a negative"},
      {"exp(1000 * t)", 0.7097827, "beyond all numbers"},
  };
  constexpr double kFound = 1e-6;  // s; a double zero is found to the square root of rounding
  for (const FaultCase& k : cases) {
    const auto fault = Expression(k.text, "").FindFault(2.0, 0);
    ASSERT_TRUE(fault) << k.text;
    EXPECT_NEAR(fault->t, k.t, kFound) << k.text;
    EXPECT_THAT(fault->reason, HasSubstr(k.reason)) << k.text;
  }
}

TEST(Expression, FindsNothingWrongWithWhatIsFinite) {
  for (const char* text : {"1 / (t + 0.1)", "1 / (t ^ 2 + 1e-3)", "1 / (step(t - 1) - 0.5)",
                           "sqrt(t)", "abs(t - 1) / 2", "1 / (2 + sin(50 * t))", "t ^ 0.5", "3"}) {
    EXPECT_FALSE(Expression(text, "").FindFault(2.0, 0)) << text;
  }
  // Its value is finite at 0, its rate is not.
  EXPECT_FALSE(Expression("sqrt(t)", "").FindFault(2.0, 0));
  EXPECT_TRUE(Expression("sqrt(t)", "").FindFault(2.0, 1));
}

}  // namespace
}  // namespace unfurl::data::expression_test
