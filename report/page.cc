#include "report/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/provenance.h"
#include "report/assets.h"
#include "report/chart.h"
#include "report/escape.h"
#include "report/figure_data.h"
#include "report/map.h"
#include "report/motion.h"
#include "report/page_scripts.h"
#include "report/paths.h"
#include "report/plane_unit.h"
#include "report/space.h"

namespace unfurl::report {
namespace {

// The page's policy forbids the browser to fetch anything, whatever the page holds.
constexpr char kPolicy[] =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";

const char* ClassOf(Level level) {
  switch (level) {
    case Level::kGood:
      return " good";
    case Level::kCare:
      return " care";
    case Level::kBad:
      return " bad";
    case Level::kNeutral:
      break;
  }
  return "";
}

// The level in a word and a shape, for whoever does not see the colour.
const char* SignOf(Level level) {
  switch (level) {
    case Level::kGood:
      return "\u2713 good";
    case Level::kCare:
      return "\u25b2 with care";
    case Level::kBad:
      return "\u2715 not usable";
    case Level::kNeutral:
      break;
  }
  return "";
}

// A page of a program that has gone looks like one of a program at work: it counts its own age.
std::string StaleBanner(double every, double written) {
  constexpr double kLate = 5.0;  // missed readings of the page: a busy machine misses one or two
  return fmt::format(
      "<section class=\"panel words bad\" id=\"stale\" role=\"alert\" hidden><p>Nothing new for "
      "<span id=\"age\"></span> s: the program that writes this page has stopped.</p></section>\n"
      "<script>(() => {{\n  const look = () => {{\n    const age = Date.now() / 1000 - {:.3f};\n"
      "    document.getElementById(\"stale\").hidden = age < {};\n"
      "    document.getElementById(\"age\").textContent = Math.round(age);\n  }};\n"
      "  look();\n  setInterval(look, 500);\n}})();</script>\n",
      written, kLate * every);
}

std::string Heading(const std::string& title, const std::string& note) {
  std::string html;
  if (!title.empty()) html += "<h3>" + EscapeHtml(title) + "</h3>\n";
  if (!note.empty()) html += "<p class=\"note\">" + EscapeHtml(note) + "</p>\n";
  return html;
}

// A number of a terminal as it is printed: "-0.000" is a zero that was rounded, "0.1 +- 0.2 um" has
// signs of its own.
std::string Typeset(std::string text) {
  if (text.size() > 1 && text[0] == '-' && text[1] == '0') {
    const std::size_t end = text.find_first_not_of("0.", 1);
    if (end == std::string::npos || text[end] == ' ' || text[end] == '%') text.erase(0, 1);
  }
  const std::size_t about = text.find("+-");
  if (about != std::string::npos) text.replace(about, 2, "\u00b1");
  if (text.size() > 1 && text[0] == 'x' && text[1] >= '0' && text[1] <= '9') {
    text.replace(0, 1, "\u00d7");  // a factor
  }
  if (text.ends_with(" um")) text.replace(text.size() - 2, 1, "\u00b5");
  return text;
}

// A sentence; what is typed, as "--bar 0.6m+-0.1mm", stays.
std::string TypesetWords(std::string text) {
  const std::string plain = " +- ";
  for (std::size_t at = 0; (at = text.find(plain, at)) != std::string::npos;) {
    text.replace(at, plain.size(), " \u00b1 ");
  }
  return text;
}

// A line does not break within "[N m]".
std::string WithWholeUnits(const std::string& text) {
  const std::size_t from = text.find('['), to = text.find(']');
  if (from == std::string::npos || to == std::string::npos || to < from) return text;
  return text.substr(0, from) + "<span class=\"unit\">" + text.substr(from, to + 1 - from) +
         "</span>" + text.substr(to + 1);
}

// Numbers and short words stand on one line.
std::string Cell(const std::string& text, bool is_text) {
  constexpr std::size_t kWhole = 28;  // letters: the longest that a column of names asks for
  if (!is_text) {
    const char* prose = text.size() > 2 * kWhole ? " class=\"prose\"" : "";
    return fmt::format("<td{}>{}</td>", prose, EscapeHtml(Typeset(text)));
  }
  return fmt::format("<td class=\"text{}\">{}</td>", text.size() > kWhole ? " prose" : "",
                     EscapeHtml(text));
}

// Panels before the first section stand right below the page's title: so do their headings. All
// text is escaped and data have no '<', so tags are tags.
std::string WithHeadingsInOrder(const std::string& body) {
  const std::size_t first = std::min(body.find("<h2>"), body.size());
  std::string before = body.substr(0, first);
  const auto replace = [&before](std::string_view what, std::string_view by) {
    for (std::size_t at = before.find(what); at != std::string::npos;
         at = before.find(what, at + by.size())) {
      before.replace(at, what.size(), by);
    }
  };
  replace("<h3>", "<h2 class=\"panel-title\">");
  replace("</h3>", "</h2>");
  return before + body.substr(first);
}

// Where a chart stands in the body; text has no '<' of its own.
std::string ChartPlace(std::size_t k) { return fmt::format("<chart {}>", k); }

std::string WithCharts(std::string body, const std::vector<Chart>& charts) {
  // Of all charts: some 2 MB, so that a page with a motion stays below 4.
  constexpr std::size_t kPageValues = 200'000;
  const std::size_t most =
      std::min(kMostValues, kPageValues / std::max<std::size_t>(1, charts.size()));
  std::size_t from = 0;
  for (std::size_t k = 0; k < charts.size(); ++k) {
    const std::string place = ChartPlace(k);
    const std::string html = ChartHtml(charts[k], fmt::format("plot{}", k), most);
    from = body.find(place, from);
    body.replace(from, place.size(), html);
    from += html.size();
  }
  return body;
}

}  // namespace

Page::Page(std::string title, std::string subtitle)
    : title_(std::move(title)), subtitle_(std::move(subtitle)) {}

void Page::AddWords(Level level, const std::string& headline,
                    const std::vector<std::string>& details) {
  body_ += fmt::format("<section class=\"panel words{}\">\n", ClassOf(level));
  if (level != Level::kNeutral) {
    body_ += fmt::format("<div class=\"sign\">{}</div>\n", SignOf(level));
  }
  body_ += "<p class=\"headline\">" + EscapeHtml(headline) + "</p>\n";
  for (const std::string& text : details)
    body_ += "<p>" + EscapeHtml(TypesetWords(text)) + "</p>\n";
  body_ += "</section>\n";
}

void Page::AddSection(const std::string& title, const std::string& words) {
  body_ += "<h2>" + EscapeHtml(title) + "</h2>\n";
  if (!words.empty()) body_ += "<p class=\"note\">" + EscapeHtml(TypesetWords(words)) + "</p>\n";
}

void Page::AddFigures(const std::vector<Figure>& figures) {
  body_ += "<div class=\"figures\">\n";
  for (const Figure& f : figures) {
    body_ += fmt::format(
        "<div class=\"figure{}\"><div class=\"name\">{}</div><div class=\"value\">{}</div>"
        "<div class=\"about\">{}</div></div>\n",
        ClassOf(f.level), EscapeHtml(f.name), EscapeHtml(Typeset(f.value)), EscapeHtml(f.note));
  }
  body_ += "</div>\n";
}

void Page::AddTable(const Table& table) {
  constexpr std::size_t kScreen = 24;  // rows that a screen shows; more scroll beneath their head
  const auto is_text = [&](std::size_t column) {
    return std::find(table.text_columns.begin(), table.text_columns.end(),
                     static_cast<int>(column)) != table.text_columns.end();
  };
  const auto head = [&](std::size_t column) {
    const std::string& text = table.header[column];
    // An empty head is a cell: readers announce heads.
    return fmt::format("<{0}{1}>{2}</{0}>", text.empty() ? "td" : "th",
                       is_text(column) ? " class=\"text\"" : "", WithWholeUnits(EscapeHtml(text)));
  };
  const bool headed = std::any_of(table.header.begin(), table.header.end(),
                                  [](const std::string& text) { return !text.empty(); });
  const bool is_long = table.rows.size() > kScreen;
  body_ += "<section class=\"panel\">\n" + Heading(table.title, table.note);
  body_ += fmt::format(
      "<div class=\"table{}\" role=\"group\" aria-label=\"{}\"{}><table>\n", is_long ? " long" : "",
      EscapeHtml(table.title.empty() ? "table" : table.title), is_long ? " tabindex=\"0\"" : "");
  if (headed) {
    body_ += "<thead><tr>";
    for (std::size_t k = 0; k < table.header.size(); ++k) body_ += head(k);
    body_ += "</tr></thead>\n";
  }
  body_ += "<tbody>\n";
  for (const auto& row : table.rows) {
    if (row.size() != table.header.size()) {
      throw Error(
          fmt::format("a row of {} cells under a header of {}", row.size(), table.header.size()),
          "report: table \"" + table.title + "\"", "give every row one cell per column");
    }
    body_ += "<tr>";
    for (std::size_t k = 0; k < row.size(); ++k) body_ += Cell(row[k], is_text(k));
    body_ += "</tr>\n";
  }
  body_ += "</tbody></table></div>\n</section>\n";
  ++tables_;
}

void Page::AddTimeSeries(Chart chart) {
  if (chart.group.empty()) chart.group = "time";
  if (chart.x.label.empty()) chart.x = {"time", "s", chart.x.log};
  AddChart(chart);
}

void Page::AddSpectrum(Chart chart) {
  if (chart.group.empty()) chart.group = "spectrum";
  AddChart(chart);
}

void Page::AddChart(const Chart& chart) {
  CheckChart(chart);
  body_ += ChartPlace(charts_.size());
  charts_.push_back(chart);
}

void Page::AddPaths(const Paths& given) {
  const Paths paths = InShortUnit(given);
  body_ += "<figure class=\"panel paths\">\n" + Heading(paths.title, paths.note) + PathsSvg(paths) +
           PathsData(paths) + "</figure>\n";
  ++drawings_;
}

void Page::AddMap(const Map& map) {
  body_ += "<figure class=\"panel paths\">\n" + Heading(map.title, map.note) + MapSvg(map) +
           MapData(map) + "</figure>\n";
  ++drawings_;
}

void Page::AddMotion(Motion motion) {
  body_ += MotionHtml(InShortUnit(std::move(motion)), fmt::format("motion{}", motions_));
  ++motions_;
}

void Page::AddSpace(const Space& space) {
  body_ += SpaceHtml(space, fmt::format("space{}", spaces_));
  ++spaces_;
}

void Page::AddPicture(const std::string& title, const std::string& note,
                      std::span<const std::uint8_t> png, const std::string& alternative) {
  body_ += "<figure class=\"panel picture\">\n" + Heading(title, note) + "<img alt=\"" +
           EscapeHtml(alternative) + "\" src=\"data:image/png;base64," + Base64(png) +
           "\">\n</figure>\n";
}

void Page::AddOrigin(const std::string& name, const std::string& value) {
  origin_.emplace_back(name, value);
}

void Page::AddOrigin(const data::Provenance& provenance) {
  AddOrigin("program", provenance.program);
  AddOrigin("command", provenance.command);
  for (const data::InputFile& input : provenance.inputs) {
    AddOrigin(input.path, "sha256 " + input.sha256);
  }
}

void Page::FollowEvery(double every, double written) {
  every_ = every;
  written_ = written;
}

std::string Page::Html() const {
  std::string html = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  html += fmt::format("<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n", kPolicy);
  if (every_ > 0.0) html += fmt::format("<meta http-equiv=\"refresh\" content=\"{}\">\n", every_);
  html += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  html += "<title>" + EscapeHtml(title_) + "</title>\n<style>\n";
  if (!charts_.empty()) html += std::string(kDygraphsStyle) + "\n";
  html += std::string(kPageStyle) + "</style>\n<style id=\"paper\" media=\"print\">\n" +
          std::string(kPaperStyle) + "</style>\n</head>\n<body>\n<header class=\"page\">\n<h1>" +
          EscapeHtml(title_) + "</h1>\n";
  if (!subtitle_.empty()) html += "<p>" + EscapeHtml(subtitle_) + "</p>\n";
  html += "</header>\n<main>\n";
  if (every_ > 0.0) html += StaleBanner(every_, written_);
  if (!charts_.empty() || motions_ + spaces_ > 0) {
    html +=
        "<noscript><section class=\"panel\">The charts need scripts, which this browser has "
        "switched off; words, tables and still pictures are all here.</section></noscript>\n";
  }
  html += WithHeadingsInOrder(WithCharts(body_, charts_)) + "</main>\n<footer>\n";
  if (!charts_.empty()) {
    html +=
        "<p class=\"hint\">Drag across a chart to zoom, double-click to see all of it; charts "
        "over the same axis move together. Click a name in a legend to hide it.</p>\n";
  }
  if (!origin_.empty()) {
    html += "<dl>\n";
    for (const auto& [name, value] : origin_) {
      html += "<dt>" + EscapeHtml(name) + "</dt><dd>" + EscapeHtml(value) + "</dd>\n";
    }
    html += "</dl>\n";
  }
  html += "</footer>\n";
  html += ScriptsOf({!charts_.empty(), drawings_ > 0, motions_ > 0, spaces_ > 0, tables_ > 0});
  html += "</body>\n</html>\n";
  return html;
}

void Page::Write(const std::string& path) const { data::WriteTextFile(path, Html()); }

}  // namespace unfurl::report
