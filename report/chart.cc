#include "report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "report/escape.h"
#include "report/thin.h"

namespace unfurl::report {
namespace {

using Json = nlohmann::ordered_json;

// Invalid UTF-8 becomes the replacement character instead of an exception.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// The number that `format` prints, so that the JSON writer's shortest form is as short as that.
double Significant(double value, int digits) {
  return std::isfinite(value) ? std::stod(fmt::format("{:.{}e}", value, digits - 1)) : value;
}

double ToPlaces(double value, int places) {
  return std::isfinite(value) ? std::stod(fmt::format("{:.{}f}", value, places)) : value;
}

// Decimal places that resolve a hundred-thousandth of the largest range of any series' y.
int PlacesFor(const std::vector<Series>& series) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Series& s : series) {
    for (const double y : s.y) {
      if (!std::isfinite(y)) continue;
      low = std::min(low, y);
      high = std::max(high, y);
    }
  }
  double range = high - low;
  if (!(range > 0.0)) range = std::isfinite(low) && low != 0.0 ? std::abs(low) : 1.0;
  return std::clamp(5 - static_cast<int>(std::floor(std::log10(range))), 0, 300);
}

std::size_t AxisIndex(std::vector<double> x, std::vector<std::vector<double>>* all) {
  for (std::size_t k = 0; k < all->size(); ++k) {
    if ((*all)[k] == x) return k;
  }
  all->push_back(std::move(x));
  return all->size() - 1;
}

// What is kept of a series; all of it in most charts.
std::vector<std::size_t> Kept(const Chart& chart, const Series& s, std::size_t most) {
  constexpr std::size_t kFewest = 400;  // of each, however many there are: peaks still show
  return LeastAndMost(s.y, std::max(kFewest, most / std::max<std::size_t>(1, chart.series.size())));
}

std::vector<double> At(const std::vector<double>& values, const std::vector<std::size_t>& kept) {
  std::vector<double> out;
  out.reserve(kept.size());
  for (const std::size_t i : kept) out.push_back(values[i]);
  return out;
}

// Said with the chart, where not all is drawn.
std::string ThinnedNote(const Chart& chart, std::size_t most) {
  std::size_t all = 0, kept = 0;
  for (const Series& s : chart.series) {
    all += s.y.size();
    kept += Kept(chart, s, most).size();
  }
  if (kept == all) return {};
  return fmt::format("Of {} values {} are drawn: the least and the largest of every short stretch.",
                     all, kept);
}

Json AxisJson(const Axis& axis) {
  Json json = {
      {"title", AxisTitle(axis)}, {"unit", axis.unit == "1" ? "" : axis.unit}, {"log", axis.log}};
  if (std::isfinite(axis.least)) json["least"] = axis.least;
  if (std::isfinite(axis.most)) json["most"] = axis.most;
  if (!axis.names.empty()) json["names"] = axis.names;
  return json;
}

const char* StyleName(Style style) {
  switch (style) {
    case Style::kDots:
      return "dots";
    case Style::kDashes:
      return "dashes";
    case Style::kLine:
      break;
  }
  return "line";
}

std::string ColorOf(const Series& s, std::size_t index) {
  return PaletteColor(s.color >= 0 ? s.color : static_cast<int>(index));
}

}  // namespace

void CheckChart(const Chart& chart) {
  const auto fail = [&](const Series& s, const std::string& what) {
    throw Error(what, "report: chart \"" + chart.title + "\", series \"" + s.name + "\"",
                "give x, y and half_width of one length, with finite x that does not fall");
  };
  for (const Series& s : chart.series) {
    if (s.x.size() != s.y.size()) {
      fail(s, fmt::format("{} x for {} y", s.x.size(), s.y.size()));
    }
    if (!s.half_width.empty() && s.half_width.size() != s.y.size()) {
      fail(s, fmt::format("{} half widths for {} y", s.half_width.size(), s.y.size()));
    }
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!std::isfinite(s.x[i])) fail(s, fmt::format("x[{}] is not finite", i));
      if (i > 0 && s.x[i] < s.x[i - 1]) fail(s, fmt::format("x falls at index {}", i));
    }
  }
}

const char* PaletteColor(int index) {
  static constexpr std::array<const char*, 8> kPalette = {
      "#0072b2", "#d55e00", "#009e73", "#aa4499", "#e69f00", "#56b4e9", "#333333", "#8c564b"};
  return kPalette[static_cast<std::size_t>(index) % kPalette.size()];
}

std::string AxisTitle(const Axis& axis) {
  if (axis.unit.empty() || axis.unit == "1") return axis.label;
  return axis.label + " [" + axis.unit + "]";
}

std::string LegendSwatch(Style style, const std::string& color, bool band) {
  std::string svg = "<svg class=\"swatch\" width=\"30\" height=\"12\" aria-hidden=\"true\">";
  if (band) {
    svg += fmt::format(
        "<rect x=\"0\" y=\"1\" width=\"30\" height=\"10\" fill=\"{}\" "
        "fill-opacity=\"0.2\"/>",
        color);
  }
  if (style == Style::kDots) {
    for (const int x : {4, 11, 19, 26}) {
      svg += fmt::format("<circle cx=\"{}\" cy=\"6\" r=\"2\" fill=\"{}\"/>", x, color);
    }
  } else {
    svg += fmt::format("<path d=\"M0 6H30\" stroke=\"{}\" stroke-width=\"2\"{}/>", color,
                       style == Style::kDashes ? " stroke-dasharray=\"6 4\"" : "");
  }
  return svg + "</svg>";
}

std::string ChartJson(const Chart& chart, std::size_t most) {
  CheckChart(chart);
  const int places = PlacesFor(chart.series);
  std::vector<std::vector<double>> axes;
  Json series = Json::array();
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    const Series& s = chart.series[k];
    const std::vector<std::size_t> kept = Kept(chart, s, most);
    Json y = Json::array();
    for (const double value : At(s.y, kept)) {
      y.push_back(chart.y.log ? Significant(value, 6) : ToPlaces(value, places));
    }
    Json entry = {{"name", s.name},
                  {"axis", AxisIndex(At(s.x, kept), &axes)},
                  {"style", StyleName(s.style)},
                  {"color", ColorOf(s, k)},
                  {"y", std::move(y)}};
    if (!s.half_width.empty()) {
      Json w = Json::array();
      for (const double value : At(s.half_width, kept)) w.push_back(Significant(value, 3));
      entry["w"] = std::move(w);
    }
    series.push_back(std::move(entry));
  }
  Json x = Json::array();
  for (const std::vector<double>& axis : axes) {
    Json values = Json::array();
    for (const double value : axis) values.push_back(Significant(value, 9));
    x.push_back(std::move(values));
  }
  Json markers = Json::array();
  for (const Marker& m : chart.markers) {
    if (!std::isfinite(m.x)) continue;
    markers.push_back({{"x", Significant(m.x, 9)},
                       {"label", m.label},
                       {"color", m.color >= 0 ? PaletteColor(m.color) : "#666666"}});
  }
  return Dump(Json{{"x", AxisJson(chart.x)},
                   {"y", AxisJson(chart.y)},
                   {"group", chart.group},
                   {"axes", std::move(x)},
                   {"series", std::move(series)},
                   {"markers", std::move(markers)}});
}

std::string ChartHtml(const Chart& chart, const std::string& id, std::size_t most) {
  const std::string json = EscapeJsonForScript(ChartJson(chart, most));
  std::string html = "<figure class=\"panel chart\">\n";
  if (!chart.title.empty()) html += "<h3>" + EscapeHtml(chart.title) + "</h3>\n";
  if (!chart.note.empty()) html += "<p class=\"note\">" + EscapeHtml(chart.note) + "</p>\n";
  const std::string thinned = ThinnedNote(chart, most);
  if (!thinned.empty()) html += "<p class=\"note\">" + thinned + "</p>\n";
  html += "<div class=\"legend\">";
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    const Series& s = chart.series[k];
    html += fmt::format(
        "<button type=\"button\" class=\"key\" data-plot=\"{}\" data-series=\"{}\" "
        "title=\"show or hide\">{}{}</button>",
        id, k, LegendSwatch(s.style, ColorOf(s, k), !s.half_width.empty()), EscapeHtml(s.name));
  }
  html += fmt::format("<output class=\"readout\" id=\"{}-readout\"></output></div>\n", id);
  html += fmt::format(
      "<div class=\"plot\" id=\"{}\" style=\"height:{}px\" role=\"img\" aria-label=\"{}\"></div>\n",
      id, chart.height_px, EscapeHtml(chart.title));
  html +=
      fmt::format("<script type=\"application/json\" class=\"chart-data\" data-plot=\"{}\">", id);
  html += json;
  html += "</script>\n</figure>\n";
  return html;
}

}  // namespace unfurl::report
