// What a moving picture keeps of what it is given.
#include "report/motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "report/plane_unit.h"

namespace unfurl::report::motion_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

json DataOf(const std::string& html) {
  const std::size_t tag = html.find("class=\"motion-data\"");
  const std::size_t from = html.find('>', tag) + 1;
  return json::parse(html.substr(from, html.find("</script>", from) - from));
}

// A beam of `points` that turns once about its start, in `frames`.
Motion Turning(std::size_t points, std::size_t frames) {
  Motion motion;
  motion.title = "turning";
  motion.x = {"x", "m", false};
  motion.y = {"y", "m", false};
  MovingLine line;
  line.name = "arm";
  line.points = points;
  for (std::size_t f = 0; f < frames; ++f) {
    const double turn = 2.0 * M_PI * static_cast<double>(f) / static_cast<double>(frames - 1);
    motion.t.push_back(0.01 * static_cast<double>(f));
    for (std::size_t p = 0; p < points; ++p) {
      const double at = static_cast<double>(p) / static_cast<double>(points - 1);
      line.xy.push_back(at * std::cos(turn));
      line.xy.push_back(at * std::sin(turn));
    }
  }
  motion.lines.push_back(line);
  return motion;
}

// Bytes that so many 32-bit numbers take as base64.
std::size_t Base64Size(std::size_t numbers) { return (4 * numbers + 2) / 3 * 4; }

TEST(Motion, KeepsAllOfWhatIsSmall) {
  const json data = DataOf(MotionHtml(Turning(17, 101), "m"));
  EXPECT_EQ(data["lines"][0]["points"], 17);
  EXPECT_EQ(data["t"].get<std::string>().size(), Base64Size(101));
  EXPECT_EQ(data["lines"][0]["xy"].get<std::string>().size(), Base64Size(2 * 17 * 101));
  // The circle, with its margin.
  for (const int side : {0, 2}) EXPECT_NEAR(data["box"][side].get<double>(), -1.12, 1e-6);
  for (const int side : {1, 3}) EXPECT_NEAR(data["box"][side].get<double>(), 1.12, 1e-6);
}

// Of half a millimetre metres' ticks would be wider than the drawing's margin.
TEST(Motion, OfASmallStructureIsInASmallUnit) {
  Motion motion = Turning(17, 101);
  EXPECT_EQ(InShortUnit(motion).x.unit, "m");
  EXPECT_EQ(InShortUnit(motion).lines[0].xy, motion.lines[0].xy);
  for (double& v : motion.lines[0].xy) v *= 5e-4;
  motion.marks.push_back({"tip", true, {0.0, 1.0}, {5e-4, 0.0}, {0.0, 5e-4}, 0});
  motion.pins.push_back({});
  motion.pins[0].xy.assign(2 * 101, 1e-4);
  const Motion small = InShortUnit(motion);
  EXPECT_EQ(small.x.unit, "mm");
  EXPECT_EQ(small.y.unit, "mm");
  EXPECT_NEAR(small.lines[0].xy[2 * 16], 0.5, 1e-12);
  EXPECT_NEAR(small.marks[0].x[0], 0.5, 1e-12);
  EXPECT_NEAR(small.marks[0].y[1], 0.5, 1e-12);
  EXPECT_NEAR(small.pins[0].xy[0], 0.1, 1e-12);
  motion.y.unit = "px";  // no plane of lengths
  EXPECT_EQ(InShortUnit(motion).x.unit, "m");
}

TEST(Motion, IsThinnedToWhatAPageMayHold) {
  Motion motion = Turning(65, 500);
  for (int k = 1; k < 100; ++k) motion.lines.push_back(motion.lines[0]);
  motion.marks.push_back({"tip", true, std::vector<double>(100000), std::vector<double>(100000),
                          std::vector<double>(100000), 0});
  for (std::size_t i = 0; i < 100000; ++i) motion.marks[0].t[i] = 1e-4 * static_cast<double>(i);
  const std::string html = MotionHtml(motion, "m");
  EXPECT_LT(html.size(), 2'000'000U);
  const json data = DataOf(html);
  EXPECT_EQ(data["lines"].size(), 100U);
  EXPECT_GE(data["lines"][0]["points"].get<int>(), 9);
  EXPECT_EQ(data["marks"][0]["t"].get<std::string>().size(), Base64Size(1500));
}

TEST(Motion, BodiesKeepEveryPoint) {
  Motion motion = Turning(65, 500);
  for (int k = 1; k < 100; ++k) motion.lines.push_back(motion.lines[0]);
  motion.lines[7].kind = MovingLine::Kind::kBody;
  EXPECT_EQ(DataOf(MotionHtml(motion, "m"))["lines"][7]["points"], 65);
}

TEST(Motion, JointsThatNeverLatchSaySo) {
  Motion motion = Turning(3, 2);
  motion.pins = {{"open", std::vector<double>(4), std::nan(""), {}},
                 {"shut", std::vector<double>(4), 0.25, {{0.1, 0.2}}}};
  const json data = DataOf(MotionHtml(motion, "m"));
  EXPECT_TRUE(data["pins"][0]["latched"].is_null());
  EXPECT_EQ(data["pins"][1]["latched"], 0.25);
  EXPECT_EQ(data["pins"][1]["contacts"], json::parse("[[0.1, 0.2]]"));
}

TEST(Motion, RefusesWhatDoesNotFitTogether) {
  Motion motion = Turning(3, 5);
  motion.lines[0].xy.pop_back();
  EXPECT_THROW(MotionHtml(motion, "m"), Error);
  EXPECT_THROW(MotionHtml(Motion{}, "m"), Error);
}

TEST(Motion, TextIsEscaped) {
  Motion motion = Turning(3, 2);
  motion.title = "<b>";
  motion.marks.push_back({"</script>", false, {0.0, 1.0}, {0.0, 1.0}, {0.0, 1.0}, 0});
  const std::string html = MotionHtml(motion, "m");
  EXPECT_THAT(html, HasSubstr("&lt;b&gt;"));
  EXPECT_EQ(DataOf(html)["marks"][0]["name"], "</script>");
}

}  // namespace
}  // namespace unfurl::report::motion_test
