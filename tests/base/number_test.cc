#include "base/number.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace unfurl::number_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Number, KeepsTheDigitsAsked) {
  EXPECT_EQ(Number(0.0), "0");
  EXPECT_EQ(Number(3.14159265), "3.142");
  EXPECT_EQ(Number(2.0), "2.000");
  EXPECT_EQ(Number(123456.0), "123456");
  EXPECT_EQ(Number(0.00012344), "0.0001234");
  EXPECT_EQ(Number(9.9996), "10.00");  // rounds into the next decade
}

TEST(Number, UsesAnExponentOnlyFarFromOne) {
  EXPECT_EQ(Number(3.2e9, 2), "3.2e9");
  EXPECT_EQ(Number(1.25e-5, 3), "1.25e\u22125");
  EXPECT_EQ(Number(1e6, 1), "1000000");
}

TEST(Number, HasATrueMinusAndNoMinusZero) {
  EXPECT_EQ(Number(-1.5, 2), "\u22121.5");
  EXPECT_EQ(Number(-0.0), "0");
}

TEST(Number, SaysWhatIsNotANumber) {
  EXPECT_EQ(Number(kNan), "\u2013");
  EXPECT_EQ(Number(kInfinity), "\u221e");
  EXPECT_EQ(Number(-kInfinity), "\u2212\u221e");
}

TEST(NumberWithError, EndsBothAtTheSamePlace) {
  EXPECT_EQ(NumberWithError(0.0052131, 0.0000213), "0.005213 \u00b1 0.000021");
  EXPECT_EQ(NumberWithError(-1234.56, 78.9), "\u22121235 \u00b1 79");
  EXPECT_EQ(NumberWithError(0.0, 0.25), "0.00 \u00b1 0.25");
}

TEST(NumberWithError, SharesOnePowerOfTen) {
  EXPECT_EQ(NumberWithError(2.04e-5, 1.1e-6), "(2.04 \u00b1 0.11)e\u22125");
  EXPECT_EQ(NumberWithError(3.2e9, 1.5e8), "(3.20 \u00b1 0.15)e9");
}

// However narrow, the ends read back are apart by the interval's width, to a tenth of it.
TEST(IntervalText, TellsTheEndsApart) {
  EXPECT_EQ(IntervalText(0.02, 0.03), "0.02 to 0.03");
  EXPECT_EQ(IntervalText(0.019999998, 0.020000003), "0.019999998 to 0.020000003");
  EXPECT_EQ(IntervalText(-1.5, kInfinity), "-1.5 to open");
  EXPECT_EQ(IntervalText(2.0, 2.0), "2 to 2");
  for (const double centre : {0.02, -3.7e8, 9.99999e-5, 1.0}) {
    for (double part = 0.5; part > 1e-13; part /= 3.0) {
      const double low = centre - part * std::abs(centre), high = centre + part * std::abs(centre);
      const std::string text = IntervalText(low, high);
      const double width = std::stod(text.substr(text.find(" to ") + 4)) - std::stod(text);
      EXPECT_NEAR(width, high - low, 0.1 * (high - low)) << text;
    }
  }
}

TEST(UnitAfter, PlainNumbersHaveNone) {
  EXPECT_EQ(UnitAfter("rad"), " rad");
  EXPECT_EQ(UnitAfter("1"), "");
  EXPECT_EQ(UnitAfter(""), "");
}

TEST(NumberWithError, WithoutAnErrorIsTheNumber) {
  EXPECT_EQ(NumberWithError(1.5, kNan, 2), "1.5");
  EXPECT_EQ(NumberWithError(1.5, 0.0, 2), "1.5");
  EXPECT_EQ(NumberWithError(kNan, 1.0), "\u2013");
}

}  // namespace
}  // namespace unfurl::number_test
