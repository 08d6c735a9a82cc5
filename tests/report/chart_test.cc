#include "report/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace unfurl::report::chart_test {
namespace {

using nlohmann::json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Chart TwoSeries() {
  Chart chart;
  chart.title = "Mark 3";
  chart.x = {"time", "s"};
  chart.y = {"x", "m"};
  chart.group = "time";
  chart.series = {{"measured", {0.0, 0.1, 0.2}, {1.0, kNan, 3.0}, {0.1, kNan, 0.1}, Style::kDots},
                  {"simulated", {0.0, 0.1, 0.2}, {1.5, 2.5, 3.5}, {}}};
  return chart;
}

TEST(ChartJson, IsValidAndHoldsTheData) {
  const json data = json::parse(ChartJson(TwoSeries()));
  EXPECT_EQ(data["x"]["title"], "time [s]");
  EXPECT_EQ(data["group"], "time");
  ASSERT_EQ(data["series"].size(), 2u);
  EXPECT_EQ(data["series"][0]["style"], "dots");
  EXPECT_EQ(data["series"][0]["w"][0], 0.1);
  EXPECT_FALSE(data["series"][1].contains("w"));
  EXPECT_NE(data["series"][0]["color"], data["series"][1]["color"]);
}

// An axis of things says their names, one of a quantity its numbers.
TEST(ChartJson, RowsHaveNames) {
  Chart chart = TwoSeries();
  EXPECT_FALSE(json::parse(ChartJson(chart))["y"].contains("names"));
  chart.y.names = {{1.0, "the data alone"}, {2.0, "all parts"}};
  EXPECT_EQ(json::parse(ChartJson(chart))["y"]["names"],
            json::parse(R"([[1.0, "the data alone"], [2.0, "all parts"]])"));
}

TEST(ChartJson, GapsAreNull) {
  Chart chart = TwoSeries();
  chart.series[1].y[0] = kInfinity;
  const json data = json::parse(ChartJson(chart));
  EXPECT_EQ(data["series"][0]["y"], json({1.0, nullptr, 3.0}));
  EXPECT_TRUE(data["series"][0]["w"][1].is_null());
  EXPECT_TRUE(data["series"][1]["y"][0].is_null());
}

TEST(ChartJson, LikeAxesAreStoredOnce) {
  Chart chart = TwoSeries();
  EXPECT_EQ(json::parse(ChartJson(chart))["axes"].size(), 1u);
  chart.series[1].x[2] = 0.21;
  const json data = json::parse(ChartJson(chart));
  EXPECT_EQ(data["axes"].size(), 2u);
  EXPECT_EQ(data["series"][1]["axis"], 1);
}

// What a picture shows: 1e-5 of the range. The bound is half a unit of the place kept.
TEST(ChartJson, RoundsFarBelowAPixel) {
  Chart chart = TwoSeries();
  chart.series.resize(1);
  Series& s = chart.series[0];
  s = {"wave", {}, {}, {}};
  const double scale = 3.7e-4;
  for (int i = 0; i < 1000; ++i) {
    s.x.push_back(1e-3 * i);
    s.y.push_back(12.0 + scale * std::sin(0.01 * i * i));
  }
  const std::string text = ChartJson(chart);
  const json data = json::parse(text);
  double worst = 0.0;
  for (std::size_t i = 0; i < s.y.size(); ++i) {
    worst = std::max(worst, std::abs(data["series"][0]["y"][i].get<double>() - s.y[i]));
    EXPECT_DOUBLE_EQ(data["axes"][0][i].get<double>(), s.x[i]);
  }
  EXPECT_LE(worst, 1e-5 * 2.0 * scale);
  EXPECT_GT(worst, 0.0);
  EXPECT_LT(text.size(), 1000u * 22u);  // 5 for x, 12 for y with its offset, commas
}

TEST(ChartJson, KeepsSixDigitsOnALogarithmicAxis) {
  Chart chart = TwoSeries();
  chart.y.log = true;
  chart.series[1].y = {1.23456789e-9, 1.0, 1e6};
  const json data = json::parse(ChartJson(chart));
  EXPECT_DOUBLE_EQ(data["series"][1]["y"][0].get<double>(), 1.23457e-9);
}

TEST(ChartJson, ConstantAndEmptySeriesAreNoTrouble) {
  Chart chart = TwoSeries();
  chart.series[0] = {"nothing", {}, {}, {}};
  chart.series[1].y = {2.5, 2.5, 2.5};
  const json data = json::parse(ChartJson(chart));
  EXPECT_EQ(data["series"][1]["y"][0], 2.5);
  chart.series.clear();
  EXPECT_EQ(json::parse(ChartJson(chart))["series"].size(), 0u);
}

TEST(ChartJson, SaysWhereAQuantityEnds) {
  Chart chart = TwoSeries();
  EXPECT_FALSE(json::parse(ChartJson(chart))["y"].contains("least"));
  chart.y.least = 0.0;
  chart.y.most = 1.0;
  const json y = json::parse(ChartJson(chart))["y"];
  EXPECT_EQ(y["least"], 0.0);
  EXPECT_EQ(y["most"], 1.0);
}

TEST(ChartJson, SurvivesHostileNames) {
  Chart chart = TwoSeries();
  chart.series[0].name = "\"</script><script>alert(1)</script>\\\n";
  chart.series[1].name = "broken \xff\xc3 text";
  const json data = json::parse(ChartJson(chart));
  EXPECT_EQ(data["series"][0]["name"], chart.series[0].name);
}

TEST(ChartJson, RefusesArraysThatDoNotFit) {
  Chart chart = TwoSeries();
  chart.series[0].y.pop_back();
  EXPECT_THROW(ChartJson(chart), Error);
  chart = TwoSeries();
  chart.series[0].half_width.pop_back();
  EXPECT_THROW(ChartJson(chart), Error);
  chart = TwoSeries();
  chart.series[0].x = {0.0, 0.2, 0.1};
  EXPECT_THROW(ChartJson(chart), Error);
  chart = TwoSeries();
  chart.series[0].x[1] = kNan;
  EXPECT_THROW(ChartJson(chart), Error);
}

TEST(ChartJson, LeavesOutMarkersThatAreNowhere) {
  Chart chart = TwoSeries();
  chart.markers = {{0.1, "here"}, {kNan, "nowhere"}};
  const json data = json::parse(ChartJson(chart));
  ASSERT_EQ(data["markers"].size(), 1u);
  EXPECT_EQ(data["markers"][0]["label"], "here");
}

}  // namespace
}  // namespace unfurl::report::chart_test
