// What of a long series a chart keeps.
#include "report/thin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "report/chart.h"

namespace unfurl::report::thin_test {
namespace {

TEST(LeastAndMost, KeepsAllOfFew) {
  const std::vector<double> x = {3.0, std::nan(""), 1.0};
  EXPECT_EQ(LeastAndMost(x, 4), (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_TRUE(LeastAndMost({}, 4).empty());
}

// A million samples with one that stands out for a single one, and a gap of two.
TEST(LeastAndMost, LosesNoPeakAndNoGap) {
  std::vector<double> x(1'000'000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(1e-4 * static_cast<double>(i));
  x[123'457] = 7.0;
  x[765'432] = -7.0;
  x[500'000] = x[500'001] = std::nan("");
  const std::vector<std::size_t> kept = LeastAndMost(x, 3000);
  EXPECT_LE(kept.size(), 3000U);
  EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
  EXPECT_EQ(std::adjacent_find(kept.begin(), kept.end()), kept.end());
  for (const std::size_t i : {0U, 123'457U, 765'432U, 500'001U, 999'999U}) {
    EXPECT_TRUE(std::binary_search(kept.begin(), kept.end(), i)) << i;
  }
  // In every column of a picture the drawn line reaches as far as the whole one.
  for (std::size_t column = 0; column < 300; ++column) {
    const std::size_t from = column * x.size() / 300, to = (column + 1) * x.size() / 300;
    double low = HUGE_VAL, high = -HUGE_VAL, own_low = HUGE_VAL, own_high = -HUGE_VAL;
    for (std::size_t i = from; i < to; ++i) {
      if (std::isnan(x[i])) continue;
      low = std::min(low, x[i]);
      high = std::max(high, x[i]);
    }
    for (const std::size_t i : kept) {
      if (i < from || i >= to || std::isnan(x[i])) continue;
      own_low = std::min(own_low, x[i]);
      own_high = std::max(own_high, x[i]);
    }
    // A stretch across the column's edge may keep its ends on the other side: what is missed is
    // what the sine does within one stretch of 1000 samples, 0.1.
    EXPECT_NEAR(own_low, low, 0.1) << column;
    EXPECT_NEAR(own_high, high, 0.1) << column;
  }
}

TEST(LeastAndMost, AChartOfAMillionStaysAPage) {
  Chart chart;
  Series s;
  for (int i = 0; i < 1'000'000; ++i) {
    s.x.push_back(1e-3 * i);
    s.y.push_back(i == 777'777 ? 5.0 : std::sin(0.01 * i));
  }
  chart.series = {s};
  const std::string html = ChartHtml(chart, "c");
  EXPECT_LT(html.size(), 1U << 20U);
  EXPECT_NE(html.find("Of 1000000 values"), std::string::npos);
  const nlohmann::json data = nlohmann::json::parse(ChartJson(chart));
  double most = 0.0;
  for (const auto& y : data["series"][0]["y"]) most = std::max(most, y.get<double>());
  EXPECT_EQ(most, 5.0);
  EXPECT_EQ(data["series"][0]["y"].size(), data["axes"][0].size());
}

}  // namespace
}  // namespace unfurl::report::thin_test
