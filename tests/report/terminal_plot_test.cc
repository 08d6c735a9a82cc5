// Curves in characters: points where they belong.
#include "report/terminal_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::report::terminal_plot_test {
namespace {

using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// The points of a picture, row by row: '#' and '.'. By reading the patterns back, as a reader
// would.
std::vector<std::string> Points(const std::string& text, int columns, int rows) {
  const std::vector<std::string> lines = Split(text, '\n');
  std::vector<std::string> out;
  for (int row = 0; row < rows; ++row) {
    const std::string& line = lines.at(static_cast<std::size_t>(row) + 1);
    const std::size_t start = line.find("\u2524") + 3;
    for (int down = 0; down < 4; ++down) {
      std::string points;
      for (int column = 0; column < columns; ++column) {
        const std::size_t at = start + 3 * static_cast<std::size_t>(column);
        const unsigned bits = ((static_cast<unsigned char>(line.at(at + 1)) & 0x3u) << 6) |
                              (static_cast<unsigned char>(line.at(at + 2)) & 0x3fu);
        // Unicode 2800: dots 1, 2, 3, 7 are the left column, 4, 5, 6, 8 the right one.
        static constexpr int kLeft[] = {0, 1, 2, 6}, kRight[] = {3, 4, 5, 7};
        points += (bits >> kLeft[down]) & 1u ? '#' : '.';
        points += (bits >> kRight[down]) & 1u ? '#' : '.';
      }
      out.push_back(points);
    }
  }
  return out;
}

TerminalPlot Small(int columns, int rows, bool joined) {
  return {"x [m]", "t [s]", columns + 11, rows, joined};
}

TEST(TerminalText, PointsAreWhereTheyBelong) {
  // A V of five points over 4 by 8 points of two characters by two.
  const std::vector<double> x = {0.0, 1.0, 1.5, 2.0, 3.0}, y = {7.0, 4.0, kNan, 0.0, 7.0};
  EXPECT_EQ(
      Points(TerminalText(Small(2, 2, false), x, y), 2, 2),
      (std::vector<std::string>{"#..#", "....", "....", ".#..", "....", "....", "....", "..#."}));
}

TEST(TerminalText, LinesJoinButNotOverGaps) {
  const std::vector<double> x = {0.0, 3.0}, y = {0.0, 7.0};
  const std::vector<std::string> rising = Points(TerminalText(Small(2, 2, true), x, y), 2, 2);
  for (const std::string& row : rising) EXPECT_THAT(row, HasSubstr("#"));
  EXPECT_EQ(rising.front().back(), '#');
  EXPECT_EQ(rising.back().front(), '#');
  const std::vector<double> t = {0.0, 1.5, 3.0}, gap = {0.0, kNan, 7.0};
  int points = 0;
  for (const std::string& row : Points(TerminalText(Small(2, 2, true), t, gap), 2, 2)) {
    points += static_cast<int>(std::count(row.begin(), row.end(), '#'));
  }
  EXPECT_EQ(points, 2);
}

TEST(TerminalText, NumbersStandAtTheAxes) {
  const std::vector<double> x = {0.5, 2.5}, y = {-0.25, 1e-3};
  const std::string text = TerminalText({"tip.x [m]", "t [s]", 60, 4, true}, x, y);
  EXPECT_THAT(text, HasSubstr("tip.x [m]\n"));
  EXPECT_THAT(text, HasSubstr("0.001\u2524"));
  EXPECT_THAT(text, HasSubstr("-0.25\u2524"));
  EXPECT_THAT(text, HasSubstr(" 0.5"));
  EXPECT_THAT(text, HasSubstr("2.5 t [s]\n"));
}

TEST(TerminalText, NothingHugeAndFlat) {
  const std::vector<double> t = {0.0, 1.0}, none = {kNan, kNan}, flat = {3.0, 3.0},
                            huge = {-1.7e308, 1.7e308};
  EXPECT_EQ(TerminalText({"x", "t", 40, 4, true}, t, none), "x: nothing to draw\n");
  EXPECT_EQ(TerminalText({"x", "t", 40, 4, true}, {}, {}), "x: nothing to draw\n");
  EXPECT_EQ(Points(TerminalText(Small(2, 2, true), t, flat), 2, 2)[4], "####");
  EXPECT_EQ(Points(TerminalText(Small(2, 2, false), t, huge), 2, 2)[0], "...#");
  EXPECT_NO_THROW(TerminalText({"x", "t", 0, 0, true}, t, flat));  // a terminal of no width
  EXPECT_THROW(TerminalText({}, t, std::vector<double>{1.0}), Error);
}

}  // namespace
}  // namespace unfurl::report::terminal_plot_test
