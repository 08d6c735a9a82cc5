// Views in space: their still, what they keep, and what they refuse.
#include "report/space.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/error.h"

namespace unfurl::report::space_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

json DataOf(const std::string& html) {
  const std::size_t tag = html.find("class=\"space-data\"");
  const std::size_t from = html.find('>', tag) + 1;
  return json::parse(html.substr(from, html.find("</script>", from) - from));
}

// A unit box; an ellipsoid of semi-axes 0.3, 0.2, 0.1, turned twice.
Space Example() {
  Space space;
  space.title = "rig";
  space.high = {1.0, 1.0, 1.0};
  space.eyes = {{"door", {2.0, 0.0, 1.0}, {}, {0.0, 0.0, 0.1}}};
  const double c = std::cos(0.7), s = std::sin(0.7);
  SpaceEllipsoid one;
  one.at = {0.5, 0.5, 0.5};
  one.axes = {{{0.3 * c, 0.3 * s, 0.0},
               {-0.2 * s * s, 0.2 * s * c, 0.2 * c},
               {0.1 * s * c, -0.1 * c * c, 0.1 * s}}};
  one.value = 1.0;
  space.ellipsoids = {{"uncertainty", {"sigma", "mm"}, {}, {one}}};
  space.clouds = {
      {"points",
       {"residual", "px"},
       {},
       {{{0.1, 0.2, 0.3}, 0.5, "P1", 1U, 0U}, {{0.4, 0.5, 0.6}, std::nan(""), "P2", 0U, 1U}}}};
  return space;
}

std::vector<double> NumbersOf(const std::string& text, const std::string& pattern) {
  std::smatch found;
  std::vector<double> out;
  if (!std::regex_search(text, found, std::regex(pattern))) return out;
  for (std::size_t k = 1; k < found.size(); ++k) out.push_back(std::stod(found[k]));
  return out;
}

// The outline by another way: the farthest that any of many points of the ellipsoid's surface
// reaches in each direction of the picture, against the drawn ellipse's reach.
TEST(Space, TheStillsEllipseIsTheEllipsoidsOutline) {
  Space space = Example();
  const std::string svg = SpaceSvg(space);
  const std::vector<double> ellipse =
      NumbersOf(svg,
                "<ellipse rx=\"([0-9.]+)\" ry=\"([0-9.]+)\" transform=\"translate\\([0-9.]+ "
                "[0-9.]+\\) rotate\\(([-0-9.]+)\\)");
  ASSERT_EQ(ellipse.size(), 3U);
  // Looked at from azimuth -60 and elevation 25 degrees; the scale from two points' distance.
  const double el = 25.0 * M_PI / 180.0, az = -60.0 * M_PI / 180.0;
  const double right[3] = {-std::sin(az), std::cos(az), 0.0};
  const double up[3] = {-std::sin(el) * std::cos(az), -std::sin(el) * std::sin(az), std::cos(el)};
  const std::regex circle("<circle cx=\"([0-9.]+)\" cy=\"([0-9.]+)\"");
  std::vector<std::array<double, 2>> drawn;
  for (std::sregex_iterator it(svg.begin(), svg.end(), circle), end; it != end; ++it) {
    drawn.push_back({std::stod((*it)[1]), std::stod((*it)[2])});
  }
  ASSERT_EQ(drawn.size(), 2U);
  // Both points differ by (0.3, 0.3, 0.3).
  const double along = 0.3 * (right[0] + right[1]), rise = 0.3 * (up[0] + up[1] + up[2]);
  const double scale =
      std::hypot(drawn[0][0] - drawn[1][0], drawn[0][1] - drawn[1][1]) / std::hypot(along, rise);
  const SpaceEllipsoid& one = space.ellipsoids[0].ellipsoids[0];
  const double turn = ellipse[2] * M_PI / 180.0;
  for (int k = 0; k < 12; ++k) {
    const double way = M_PI * k / 12.0, x = std::cos(way), y = std::sin(way);
    double farthest = 0.0;
    constexpr int kSteps = 200;  // a step of 0.9 degrees loses 1e-4 of the reach
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; j < 2 * kSteps; ++j) {
        const double theta = M_PI * i / kSteps, phi = M_PI * j / kSteps;
        const double ball[3] = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                std::cos(theta)};
        double reach = 0.0;
        for (std::size_t c = 0; c < 3; ++c) {
          double at = 0.0;
          for (std::size_t a = 0; a < 3; ++a) at += ball[a] * one.axes[a][c];
          reach += at * (x * right[c] - y * up[c]);  // down is positive in the picture
        }
        farthest = std::max(farthest, scale * reach);
      }
    }
    const double own =
        std::hypot(ellipse[0] * std::cos(way - turn), ellipse[1] * std::sin(way - turn));
    EXPECT_NEAR(own, farthest, 0.01 * farthest) << way;  // places and angles are rounded to 0.1
  }
}

// By hand: 8 in a box of volume 8 stand 1 apart; of 3e-4 it takes 1000 to span 0.3 of that, and of
// 1e-3 it takes 300, of which 200 is the round number below.
TEST(Space, EllipsoidsAreMagnifiedToBeSeen) {
  Space space;
  space.high = {2.0, 2.0, 2.0};
  space.ellipsoids.resize(1);
  const auto with = [&](double axis) {
    space.ellipsoids[0].ellipsoids.assign(
        8, {{1.0, 1.0, 1.0}, {{{axis, 0.0, 0.0}, {0.0, axis / 2.0, 0.0}, {0.0, 0.0, 0.0}}}, 1.0});
    return Magnification(space);
  };
  EXPECT_DOUBLE_EQ(with(2.99e-4), 1000.0);
  EXPECT_DOUBLE_EQ(with(1e-3), 200.0);
  EXPECT_DOUBLE_EQ(with(0.4), 1.0);  // never made smaller
  space.ellipsoids.clear();
  EXPECT_DOUBLE_EQ(Magnification(space), 1.0);
}

// In a surveyor's grid, where 32 bits tell half a metre apart: the same view, and its origin told.
TEST(Space, FarPlacesAreSeenFromTheirOwn) {
  constexpr double kNorth = 5400000.0;
  Space far = Example();
  for (Place* at : {&far.low, &far.high, &far.eyes[0].at, &far.ellipsoids[0].ellipsoids[0].at,
                    &far.clouds[0].points[0].at, &far.clouds[0].points[1].at}) {
    (*at)[1] += kNorth;
  }
  json near = DataOf(SpaceHtml(Example(), "s")), seen = DataOf(SpaceHtml(far, "s"));
  EXPECT_EQ(seen["low"], near["low"]);
  EXPECT_EQ(seen["eyes"][0]["at"], near["eyes"][0]["at"]);
  EXPECT_THAT(SpaceHtml(far, "s"), HasSubstr("Axes count from (0, 5400000, 0) m."));
  EXPECT_THAT(SpaceHtml(Example(), "s"), Not(HasSubstr("count from")));
}

TEST(Space, KeepsNamesAndWhoSawWhat) {
  const std::string html = SpaceHtml(Example(), "s");
  const json data = DataOf(html);
  EXPECT_EQ(data["eyes"][0]["name"], "door");
  EXPECT_EQ(data["clouds"][0]["labels"], (json{"P1", "P2"}));
  EXPECT_EQ(data["clouds"][0]["seen"], (json{1, 0}));
  EXPECT_EQ(data["clouds"][0]["refused"], (json{0, 1}));
  EXPECT_EQ(data["clouds"][0]["scale"]["title"], "residual [px]");
  EXPECT_EQ(data["colors"][0], "#440154");
  EXPECT_EQ(data["colors"].back(), "#fde725");
  EXPECT_THAT(html, HasSubstr("fill=\"#aaa\""));  // of the point without a value
}

TEST(Space, RefusesWhatCannotBeDrawn) {
  const auto refused = [](auto change) {
    Space space = Example();
    change(space);
    EXPECT_THROW(SpaceHtml(space, "s"), Error);
    EXPECT_THROW(SpaceSvg(space), Error);
  };
  refused([](Space& s) { s.high[2] = s.low[2]; });
  refused([](Space& s) { s.eyes.resize(33); });
  refused([](Space& s) { s.eyes[0].field = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}}; });
  refused([](Space& s) { s.eyes[0].at[1] = std::nan(""); });
  refused([](Space& s) { s.clouds[0].points[0].at[0] = INFINITY; });
  refused([](Space& s) { s.clouds[0].points.resize(kMostSpacePoints + 1); });
  refused([](Space& s) { s.ellipsoids[0].ellipsoids[0].axes[1][1] = std::nan(""); });
}

}  // namespace
}  // namespace unfurl::report::space_test
