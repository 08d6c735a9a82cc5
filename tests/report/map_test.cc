#include "report/map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "report/color_scale.h"

namespace unfurl::report::map_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Map Example() {
  Map map;
  map.title = "error";
  map.x = {"x", "m"};
  map.y = {"y", "m"};
  map.value = {"sigma", "mm"};
  map.x_low = map.y_low = -1.0;
  map.x_high = map.y_high = 1.0;
  map.columns = 2;
  map.panes.push_back({"z = 0 <m>", {1.0, 2.0, std::nan(""), 5.0}, {{0.5, 0.5, 5.0, "a & b"}}});
  return map;
}

TEST(Map, CellsCarryTheirColourAndValueAndNanStaysGrey) {
  const std::string svg = MapSvg(Example());
  EXPECT_THAT(svg, HasSubstr("fill=\"" + ScaleColor(0.0) + "\"><title>1.00 mm"));
  EXPECT_THAT(svg, HasSubstr("fill=\"" + ScaleColor(0.25) + "\"><title>2.00 mm"));
  EXPECT_THAT(svg, HasSubstr("fill=\"" + ScaleColor(1.0) + "\"><title>5.00 mm"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, HasSubstr("z = 0 &lt;m&gt;"));
  EXPECT_THAT(svg, HasSubstr("a &amp; b"));
}

// Far from zero the axes count from a place of their own: the drawing is that of the near one.
TEST(Map, FarAxesCountFromTheirOwn) {
  Map map = Example();
  map.y_low = 0.0;
  map.y_high = 2.0;
  const std::string near = MapSvg(map);
  map.y_low += 5400000.0;
  map.y_high += 5400000.0;
  map.panes[0].dots[0].y += 5400000.0;
  std::string svg = MapSvg(map);
  const std::string told = "y less 5400000 [m]";
  const std::size_t at = svg.find(told);
  ASSERT_NE(at, std::string::npos);
  svg.replace(at, told.size(), "y [m]");
  EXPECT_EQ(svg, near);
}

// Row 0 is the lowest: the first value's cell lies in the pane's lower left.
TEST(Map, RowsRise) {
  const std::string svg = MapSvg(Example());
  const auto y_of = [&](const std::string& title) {
    const std::size_t end = svg.find("<title>" + title);
    const std::size_t start = svg.rfind(" y=\"", end);
    return std::strtod(svg.c_str() + start + 4, nullptr);
  };
  EXPECT_GT(y_of("1.00 mm"), y_of("5.00 mm"));
}

TEST(Map, LogarithmicScaleTakesTheGeometricMiddle) {
  Map map = Example();
  map.value.log = true;
  map.panes[0].values = {1.0, 10.0, 100.0, 0.0};
  EXPECT_THAT(MapSvg(map), HasSubstr("fill=\"" + ScaleColor(0.5) + "\"><title>10.0 mm"));
}

TEST(Map, ScaleRisesInLightness) {
  double before = -1.0;
  for (int k = 0; k <= 20; ++k) {
    const std::string c = ScaleColor(k / 20.0);
    const auto part = [&](std::size_t at) {
      return std::pow(static_cast<double>(std::stoi(c.substr(at, 2), nullptr, 16)) / 255.0, 2.2);
    };
    const double light = 0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5);
    EXPECT_GT(light, before);
    before = light;
  }
}

TEST(Map, RefusesPartOfARow) {
  Map map = Example();
  map.panes[0].values.pop_back();
  EXPECT_THROW(MapSvg(map), Error);
}

}  // namespace
}  // namespace unfurl::report::map_test
