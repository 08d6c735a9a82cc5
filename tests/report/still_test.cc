#include "report/still.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "base/error.h"

namespace unfurl::report::still_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Chart Line() {
  Chart chart;
  chart.title = "A <line>";
  chart.x = {"time", "s", false};
  chart.y = {"angle", "mrad", false};
  chart.series.push_back({"simulated", {0.0, 1.0, 2.0}, {0.0, 5.0, 10.0}, {}, Style::kLine, 0});
  chart.series.push_back(
      {"measured", {0.0, 1.0, 2.0}, {0.0, 5.0, 10.0}, {1.0, 1.0, 1.0}, Style::kDots, 1});
  chart.markers.push_back({1.0, "latches", -1});
  return chart;
}

TEST(StillSvg, IsADocumentOfItsOwn) {
  const std::string svg = StillSvg(Line());
  EXPECT_EQ(svg.rfind("<svg xmlns=\"http://www.w3.org/2000/svg\"", 0), 0u);
  EXPECT_THAT(svg, HasSubstr("A &lt;line&gt;"));
  EXPECT_THAT(svg, HasSubstr("time [s]"));
  EXPECT_THAT(svg, HasSubstr("angle [mrad]"));
  EXPECT_THAT(svg, HasSubstr("latches"));
  EXPECT_THAT(svg, HasSubstr("fill-opacity"));  // the band
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(StillSvg, AStraightLineStaysStraight) {
  const std::string svg = StillSvg(Line());
  const std::size_t at = svg.find("fill=\"none\" stroke=\"#");
  const std::size_t begin = svg.rfind("d=\"M", at) + 4;
  std::string d = svg.substr(begin, svg.find('"', begin) - begin);
  for (char& c : d) c = c == 'L' ? ' ' : c;
  std::istringstream words(d);
  double x[3], y[3];
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(words >> x[i] >> y[i]) << d;
  constexpr double kPrinted = 0.11;  // one decimal, twice rounded
  EXPECT_NEAR(x[1] - x[0], x[2] - x[1], kPrinted);
  EXPECT_NEAR(y[1] - y[0], y[2] - y[1], kPrinted);
  EXPECT_LT(y[2], y[0]);  // up is up
}

TEST(StillSvg, DecadesAreEvenOnALogarithmicAxis) {
  Chart chart = Line();
  chart.y.log = true;
  chart.series = {{"s", {1.0, 2.0, 3.0, 4.0}, {0.1, 1.0, 10.0, -1.0}, {}, Style::kLine, 0}};
  const std::string svg = StillSvg(chart);
  for (const char* tick : {">0.1<", ">1<", ">10<"}) EXPECT_THAT(svg, HasSubstr(tick));
}

TEST(StillSvg, NothingToShowIsAnError) {
  Chart chart = Line();
  chart.series = {{"s", {0.0}, {std::nan("")}, {}, Style::kLine, 0}};
  EXPECT_THROW(StillSvg(chart), Error);
}

}  // namespace
}  // namespace unfurl::report::still_test
