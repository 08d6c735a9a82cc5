#include "base/length.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/fixed_number.h"
#include "base/random.h"
#include "base/statistics.h"
#include "base/stream_median.h"

namespace unfurl::length_test {
namespace {

TEST(Length, IsWrittenInTheUnitThatSuitsIt) {
  EXPECT_EQ(LengthText(0.000312), "0.312 mm");
  EXPECT_EQ(LengthText(1.284), "1.28 m");
  EXPECT_EQ(LengthText(0.0412), "41.2 mm");
  EXPECT_EQ(LengthText(4.12e-6), "4.12 um");
  EXPECT_EQ(LengthText(-0.002), "-2 mm");
  EXPECT_EQ(LengthText(0.0), "0 mm");
  EXPECT_EQ(LengthText(std::nan("")), "-");
}

// Records of milliseconds are told apart as those of minutes are.
TEST(Time, HasDigitsEnoughWhereItIsShort) {
  EXPECT_EQ(FixedNumber(1.96831), "1.9683");
  EXPECT_EQ(FixedNumber(1.96831, 2), "1.97");
  EXPECT_EQ(FixedNumber(0.0), "0.0000");
  EXPECT_EQ(FixedNumber(0.1), "0.1000");
  EXPECT_EQ(FixedNumber(0.00196831), "0.001968");
  EXPECT_EQ(FixedNumber(-0.00196831, 2), "-0.0020");
  EXPECT_EQ(FixedNumber(7.6e-7, 2), "0.00000076");
  EXPECT_EQ(FixedNumber(3602.5), "3602.5000");
}

TEST(Length, IsReadWithItsUnit) {
  double metres = 0.0;
  EXPECT_TRUE(ParseLength("0.5mm", &metres));
  EXPECT_DOUBLE_EQ(metres, 0.5e-3);
  EXPECT_TRUE(ParseLength(" 2 cm ", &metres));
  EXPECT_DOUBLE_EQ(metres, 0.02);
  EXPECT_TRUE(ParseLength("3ft", &metres));
  EXPECT_DOUBLE_EQ(metres, 0.9144);
  EXPECT_TRUE(ParseLength("30 in", &metres));
  EXPECT_DOUBLE_EQ(metres, 0.762);
  EXPECT_TRUE(ParseLength("20um", &metres));
  EXPECT_DOUBLE_EQ(metres, 20e-6);
  EXPECT_TRUE(ParseLength("1e-3", &metres));
  EXPECT_DOUBLE_EQ(metres, 1e-3);
  for (const char* wrong : {"", "mm", "5 px", "1 yd", "inf", "nan m", "0.5 mm2"}) {
    EXPECT_FALSE(ParseLength(wrong, &metres)) << wrong;
  }
}

TEST(StreamMedian, IsTheMedianWhateverTheSize) {
  Rng rng(4);
  for (const double scale : {1e-12, 1.0, 1e9}) {
    StreamMedian stream;
    std::vector<double> values;
    for (int k = 0; k < 5001; ++k) {
      values.push_back(scale * std::exp(2.0 * rng.Normal()));
      stream.Add(values.back());
    }
    EXPECT_NEAR(stream.Get() / Median(values), 1.0, 0.0051);  // half a bin
  }
  EXPECT_EQ(StreamMedian().Get(), 0.0);
}

}  // namespace
}  // namespace unfurl::length_test
