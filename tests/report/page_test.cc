#include "report/page.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "base/error.h"
#include "data/atomic_file.h"
#include "report/space.h"

namespace unfurl::report::page_test {
namespace {

constexpr char kHostile[] = "</script><script>alert('&\"')</script><!-- <img src=x onerror=y>";

std::size_t Count(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
    ++count;
  }
  return count;
}

// A wave in time with a band, `n` samples, shifted by `phase`.
Series Wave(const std::string& name, int n, double phase) {
  Series s;
  s.name = name;
  for (int i = 0; i < n; ++i) {
    s.x.push_back(i * 1e-3 + 2e-4 * std::floor(phase));
    s.y.push_back(std::sin(7.0 * s.x.back() + phase) / 3.0);
    s.half_width.push_back(2e-4 * (1.1 + std::sin(0.3 * i)));
  }
  return s;
}

// One of every panel, every text of it `text`.
Page Everything(const std::string& text) {
  Page page(text, text);
  page.AddWords(Level::kGood, text, {text, text});
  page.AddSection(text, text);
  page.AddFigures({{text, text, text, Level::kCare}});
  Table table;
  table.title = text;
  table.note = text;
  table.header = {text, text};
  table.rows = {{text, text}};
  page.AddTable(table);
  Chart chart;
  chart.title = text;
  chart.note = text;
  chart.x = {text, text};
  chart.y = {text, text};
  chart.series = {Wave(text, 20, 0.0), Wave(text, 20, 1.0)};
  chart.markers = {{0.01, text}};
  page.AddTimeSeries(chart);
  page.AddSpectrum(chart);
  Paths paths;
  paths.title = text;
  paths.note = text;
  paths.x = {text, text};
  paths.y = {text, text};
  Path path;
  path.name = text;
  path.x = {0.0, 1.0};
  path.y = {0.0, 1.0};
  paths.paths = {path};
  page.AddPaths(paths);
  Map map;
  map.title = text;
  map.x = map.y = map.value = {text, text};
  map.columns = 2;
  map.panes = {{text, {1.0, std::nan(""), 3.0, 4.0}, {{0.5, 0.5, 2.0, text}}}};
  page.AddMap(map);
  Space space;
  space.title = text;
  space.note = text;
  space.unit = text;
  space.high = {1.0, 1.0, 1.0};
  space.eyes = {{text, {2.0, 2.0, 2.0}, {}, {}}};
  space.clouds = {{text, {text, text}, {}, {{{0.5, 0.5, 0.5}, 1.0, text}}}};
  space.ellipsoids = {{text, {text, text}, {}, {}}};
  page.AddSpace(space);
  page.AddPicture(text, text, std::vector<std::uint8_t>{1, 2, 3}, text);
  page.AddOrigin(text, text);
  return page;
}

// Whatever text goes in, the page's elements are those of harmless text.
TEST(Page, TextNeverBecomesMarkup) {
  const std::string plain = Everything("plain").Html();
  const std::string hostile = Everything(kHostile).Html();
  EXPECT_EQ(hostile.find("<img src=x"), std::string::npos);
  for (const char* tag : {"<script", "</script", "<img", "<p", "<td", "<!--", "<svg", "<button"}) {
    EXPECT_EQ(Count(hostile, tag), Count(plain, tag)) << tag;
  }
}

TEST(Page, SignsAreTypesetInWordsAndCells) {
  Page page("Signs");
  page.AddWords(Level::kGood, "good", {"scatter 0.80 +- 0.02; give --bar 0.6m+-0.1mm"});
  Table table;
  table.header = {"what", "without"};
  table.rows = {{"x1", "x1.32"}};  // a name, and a factor
  page.AddTable(table);
  const std::string html = page.Html();
  EXPECT_NE(html.find("0.80 \u00b1 0.02; give --bar 0.6m+-0.1mm"), std::string::npos);
  EXPECT_NE(html.find("\u00d71.32"), std::string::npos);
  EXPECT_NE(html.find(">x1<"), std::string::npos);
}

TEST(Page, ScriptsOpenAndClose) {
  const std::string html = Everything("x").Html();
  EXPECT_EQ(Count(html, "<script"), Count(html, "</script>"));
  // Five blocks of data (two charts, paths, a map, a space); the tools; dygraphs, its extra and the
  // charts' own; the buttons that save; three.js and the view's own.
  EXPECT_EQ(Count(html, "<script"), 12u);
}

TEST(Page, NeedsNoNetwork) {
  std::string html = Everything("x").Html();
  // The names of HTML and SVG themselves: nothing is fetched by them.
  html = std::regex_replace(html, std::regex("http://www.w3.org/(1999/xhtml|2000/svg)"), "");
  for (const char* scheme : {"http://", "https://", "file://", "src=\"//", "@import"}) {
    EXPECT_EQ(html.find(scheme), std::string::npos) << scheme;
  }
  const std::regex source("(src|href)=\"([^\"]*)\"");
  for (std::sregex_iterator it(html.begin(), html.end(), source), end; it != end; ++it) {
    EXPECT_EQ((*it)[2].str().substr(0, 15), "data:image/png;");
  }
  // And the browser is told to fetch nothing.
  EXPECT_NE(html.find("Content-Security-Policy\" content=\"default-src 'none'"), std::string::npos);
  EXPECT_EQ(html.find("sourceMappingURL"), std::string::npos);
}

TEST(Page, CarriesTheChartLibraryOnlyWithCharts) {
  const std::string with = Everything("x").Html();
  EXPECT_NE(with.find("Dan Vanderkam"), std::string::npos);
  EXPECT_NE(with.find("Dygraph"), std::string::npos);
  Page words("title");
  words.AddWords(Level::kBad, "Do not use.");
  EXPECT_LT(words.Html().size(), 12000u);  // the style, next to nothing else
  EXPECT_EQ(words.Html().find("<script"), std::string::npos);
}

TEST(Page, CarriesTheLibraryOfSpaceOnlyWithSpaces) {
  EXPECT_NE(Everything("x").Html().find("three.js authors"), std::string::npos);
  Page chart("title");
  chart.AddTimeSeries({});
  EXPECT_EQ(chart.Html().find("three.js"), std::string::npos);
}

// A record of many channels: a page grows with what is seen, not with what was recorded.
TEST(Page, StaysOfOneSizeHoweverManyChartsItHas) {
  const auto size = [](int charts) {
    Page page("title");
    for (int c = 0; c < charts; ++c) {
      Chart chart;
      chart.series = {Wave("a", 40000, 0.1 * c)};
      chart.series[0].half_width.clear();
      page.AddTimeSeries(std::move(chart));
    }
    return page.Html().size();
  };
  EXPECT_LT(size(40), 4'000'000u);   // bytes, what a page may be
  EXPECT_GT(size(2), 2u * 300'000);  // and one of two charts is not thinned for that
}

TEST(Page, NumbersOfTablesArePrintedAndUnitsStayWhole) {
  Page page("title");
  Table table;
  table.title = "t";
  table.header = {"name", "moment [N m]", "error"};
  table.rows = {
      {"a", "-0.000", "0.1 +- 0.2"}, {"b", "-0.001", "3 um"}, {"-0.0 c", "-0", "-0.5 mm"}};
  page.AddTable(table);
  const std::string html = page.Html();
  EXPECT_NE(html.find("moment <span class=\"unit\">[N m]</span>"), std::string::npos);
  EXPECT_NE(html.find("<td>0.000</td>"), std::string::npos);
  EXPECT_NE(html.find("<td>-0.001</td>"), std::string::npos);
  EXPECT_NE(html.find("<td>0.1 \u00b1 0.2</td>"), std::string::npos);
  EXPECT_NE(html.find("<td>3 \u00b5m</td>"), std::string::npos);
  EXPECT_NE(html.find("<td>0</td><td>-0.5 mm</td>"), std::string::npos);
  EXPECT_NE(html.find("-0.0 c"), std::string::npos);  // a name is no number
}

TEST(Page, OnlyLongTablesScrollAndOnlyNamedColumnsHaveAHead) {
  const auto with_rows = [](std::size_t rows, const std::string& head) {
    Page page("title");
    Table table;
    table.header = {head, head};
    table.rows.assign(rows, {"a", "1"});
    page.AddTable(table);
    return page.Html();
  };
  EXPECT_EQ(with_rows(24, "x").find("class=\"table long\""), std::string::npos);
  EXPECT_NE(with_rows(25, "x").find("class=\"table long\""), std::string::npos);
  EXPECT_NE(with_rows(2, "x").find("<thead>"), std::string::npos);
  EXPECT_EQ(with_rows(2, "").find("<thead>"), std::string::npos);
}

TEST(Page, SameCallsSameBytes) {
  EXPECT_EQ(Everything("x").Html(), Everything("x").Html());
  const Page page = Everything("x");
  EXPECT_EQ(page.Html(), page.Html());
}

TEST(Page, DataBlocksAreJson) {
  const std::string html = Everything(kHostile).Html();
  const std::string open = "class=\"chart-data\"";
  int blocks = 0;
  for (std::size_t at = html.find(open); at != std::string::npos; at = html.find(open, at + 1)) {
    const std::size_t begin = html.find('>', at) + 1;
    const std::size_t end = html.find("</script>", begin);
    const nlohmann::json data = nlohmann::json::parse(html.substr(begin, end - begin));
    EXPECT_EQ(data["series"][0]["name"], kHostile);
    EXPECT_EQ(data["series"][0]["y"].size(), 20u);
    ++blocks;
  }
  EXPECT_EQ(blocks, 2);
}

// By hand: cells of a unit square in two columns lie at 1/4 and 3/4, the lowest row first.
TEST(Page, DrawingsCarryTheirNumbers) {
  const std::string html = Everything(kHostile).Html();
  const std::string open = "class=\"figure-data\"";
  std::vector<nlohmann::json> blocks;
  for (std::size_t at = html.find(open); at != std::string::npos; at = html.find(open, at + 1)) {
    const std::size_t begin = html.find('>', at) + 1;
    blocks.push_back(
        nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin)));
  }
  ASSERT_EQ(blocks.size(), 2u);
  const auto list = [](const char* text) { return nlohmann::json::parse(text); };
  EXPECT_EQ(blocks[0]["columns"][1], list("[0.0, 1.0]"));
  EXPECT_EQ(blocks[0]["columns"][0][0], kHostile);
  EXPECT_EQ(blocks[1]["columns"][1], list("[0.25, 0.75, 0.25, 0.75, 0.5]"));
  EXPECT_EQ(blocks[1]["columns"][2], list("[0.25, 0.25, 0.75, 0.75, 0.5]"));
  EXPECT_EQ(blocks[1]["columns"][3], list("[1.0, null, 3.0, 4.0, 2.0]"));
  EXPECT_EQ(blocks[1]["columns"][4][4], kHostile);
}

TEST(Page, ALongTrialStaysSmall) {
  Page page("title");
  Chart chart;
  for (int k = 0; k < 8; ++k) chart.series.push_back(Wave(fmt::format("s{}", k), 5000, k));
  page.AddTimeSeries(chart);
  EXPECT_LT(page.Html().size(), 3u * 1024u * 1024u);
}

TEST(Page, TableRowsMustFit) {
  Page page("title");
  Table table;
  table.header = {"a", "b"};
  table.rows = {{"only one"}};
  EXPECT_THROW(page.AddTable(table), Error);
}

TEST(Page, LevelsAreSaidInWords) {
  const auto with = [](Level level) {
    Page page("title");
    page.AddWords(level, "headline");
    return page.Html();
  };
  EXPECT_NE(with(Level::kGood).find("good</div>"), std::string::npos);
  EXPECT_NE(with(Level::kCare).find("with care</div>"), std::string::npos);
  EXPECT_NE(with(Level::kBad).find("not usable</div>"), std::string::npos);
}

TEST(Page, IsWrittenWhole) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "unfurl_page_test";
  std::filesystem::create_directories(folder);
  const Page page = Everything("x");
  const std::string path = (folder / "page.html").string();
  page.Write(path);
  EXPECT_EQ(data::ReadTextFile(path), page.Html());
  EXPECT_THROW(page.Write((folder / "absent" / "page.html").string()), Error);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace unfurl::report::page_test
