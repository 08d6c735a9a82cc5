#include "report/paths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "base/error.h"

namespace unfurl::report::paths_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// What the first curve in the SVG says in its d attribute (ticks have no L in theirs).
std::string FirstCurveText(const std::string& svg) {
  const std::string open = "<path d=\"";
  for (std::size_t at = svg.find(open); at != std::string::npos; at = svg.find(open, at + 1)) {
    const std::size_t begin = at + open.size();
    const std::string d = svg.substr(begin, svg.find('"', begin) - begin);
    if (d.find('L') != std::string::npos) return d;
  }
  ADD_FAILURE() << "no curve";
  return {};
}

std::vector<std::pair<double, double>> FirstCurve(const std::string& svg) {
  std::string d = FirstCurveText(svg);
  std::replace_if(
      d.begin(), d.end(), [](char c) { return c == 'M' || c == 'L'; }, ' ');
  std::istringstream words(d);
  std::vector<std::pair<double, double>> points;
  for (double x = 0.0, y = 0.0; words >> x >> y;) points.emplace_back(x, y);
  return points;
}

Paths Circle() {
  Paths paths;
  paths.title = "circle";
  paths.x = {"x", "m"};
  paths.y = {"y", "m"};
  Path path;
  path.name = "mark";
  for (int i = 0; i <= 3600; ++i) {
    path.x.push_back(2.0 + 0.5 * std::cos(i * M_PI / 1800.0));
    path.y.push_back(-7.0 + 0.5 * std::sin(i * M_PI / 1800.0));
  }
  paths.paths = {path};
  return paths;
}

TEST(Ticks, AreRoundAndInside) {
  EXPECT_EQ(Ticks(0.0, 10.0, 5), (std::vector<double>{0.0, 2.0, 4.0, 6.0, 8.0, 10.0}));
  const std::vector<double> ticks = Ticks(-0.123, 0.377, 5);
  ASSERT_EQ(ticks.size(), 5u);  // -0.1, 0, 0.1, 0.2, 0.3
  EXPECT_NEAR(ticks.front(), -0.1, 1e-12);
  EXPECT_NEAR(ticks.back(), 0.3, 1e-12);
  EXPECT_TRUE(Ticks(1.0, 1.0, 5).empty());
  EXPECT_TRUE(Ticks(0.0, kNan, 5).empty());
}

TEST(PathsSvg, HasOneScaleForBothAxes) {
  const auto points = FirstCurve(PathsSvg(Circle()));
  double cx = 0.0, cy = 0.0;
  for (const auto& [x, y] : points) {
    cx += x / static_cast<double>(points.size());
    cy += y / static_cast<double>(points.size());
  }
  const double radius = std::hypot(points[0].first - cx, points[0].second - cy);
  EXPECT_GT(radius, 50.0);
  // Coordinates are printed to 0.1, the centre is a mean over a closed curve's samples.
  for (const auto& [x, y] : points) EXPECT_NEAR(std::hypot(x - cx, y - cy), radius, 1.0);
}

TEST(PathsSvg, ThinsWhatNobodyCouldSee) {
  Paths paths = Circle();
  const std::size_t before = FirstCurve(PathsSvg(paths)).size();
  Path& path = paths.paths[0];
  for (int i = 0; i < 100000; ++i) {  // stands still
    path.x.push_back(path.x.back());
    path.y.push_back(path.y.back());
  }
  EXPECT_EQ(FirstCurve(PathsSvg(paths)).size(), before);
}

TEST(PathsSvg, NanLiftsThePen) {
  Paths paths = Circle();
  for (int i = 1000; i < 1200; ++i) paths.paths[0].y[static_cast<std::size_t>(i)] = kNan;
  const std::string svg = PathsSvg(paths);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  const std::string d = FirstCurveText(svg);
  EXPECT_EQ(std::count(d.begin(), d.end(), 'M'), 2);
}

TEST(PathsSvg, OnePointAndNoPoint) {
  Paths paths = Circle();
  paths.paths[0].x = {1.0};
  paths.paths[0].y = {1.0};
  EXPECT_EQ(PathsSvg(paths).find("nan"), std::string::npos);
  paths.paths[0].y = {kNan};
  EXPECT_NE(PathsSvg(paths).find("No data"), std::string::npos);
  paths.paths[0].y = {};
  EXPECT_THROW(PathsSvg(paths), Error);
}

}  // namespace
}  // namespace unfurl::report::paths_test
