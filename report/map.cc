#include "report/map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number.h"
#include "report/chart.h"
#include "report/color_scale.h"
#include "report/escape.h"
#include "report/far_origin.h"
#include "report/paths.h"

namespace unfurl::report {
namespace {

// Of the drawing, in its own units: the pane's width and what stands around it.
constexpr double kPane = 300.0, kMapLeft = 52.0, kMapTop = 24.0, kMapBottom = 44.0, kGap = 14.0;
constexpr double kBar = 54.0;  // height of the scale with its numbers

ColorScale ScaleFor(const Map& map) {
  std::vector<double> values;
  for (const MapPane& pane : map.panes) {
    values.insert(values.end(), pane.values.begin(), pane.values.end());
    for (const MapDot& dot : pane.dots) values.push_back(dot.value);
  }
  return ScaleOf(values, map.value.log, map.low, map.high);
}

std::string Rect(double x, double y, double w, double h, const std::string& fill,
                 const std::string& title) {
  return fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\">"
      "<title>{}</title></rect>",
      x, y, w, h, fill, EscapeHtml(title));
}

// A pane's values as rectangles, row by row from below; those that are not finite stay grey.
std::string Cells(const Map& map, const MapPane& pane, const ColorScale& scale, double left,
                  double height) {
  if (pane.values.empty()) return {};
  if (map.columns < 1 || pane.values.size() % static_cast<std::size_t>(map.columns) != 0) {
    throw Error(fmt::format("{} values in rows of {}", pane.values.size(), map.columns),
                "report: map \"" + map.title + "\"", "give whole rows");
  }
  const std::string unit =
      map.value.unit.empty() || map.value.unit == "1" ? "" : " " + map.value.unit;
  const std::size_t columns = static_cast<std::size_t>(map.columns);
  const std::size_t rows = pane.values.size() / columns;
  const double w = kPane / static_cast<double>(columns), h = height / static_cast<double>(rows);
  std::string svg;
  for (std::size_t i = 0; i < pane.values.size(); ++i) {
    const double value = pane.values[i];
    if (!std::isfinite(value)) continue;
    const std::size_t column = i % columns, row = rows - 1 - i / columns;
    svg += Rect(left + w * static_cast<double>(column), kMapTop + h * static_cast<double>(row),
                w + 0.3, h + 0.3, ScaleColor(scale.Share(value)), Number(value, 3) + unit);
  }
  return svg + "\n";
}

// With axes that count from a place of their own where they are far from zero.
Map AboutItself(Map map) {
  const double x = FarOrigin(map.x_low, map.x_high), y = FarOrigin(map.y_low, map.y_high);
  if (x == 0.0 && y == 0.0) return map;
  map.x_low -= x;
  map.x_high -= x;
  map.y_low -= y;
  map.y_high -= y;
  for (MapPane& pane : map.panes) {
    for (MapDot& dot : pane.dots) {
      dot.x -= x;
      dot.y -= y;
    }
  }
  map.x.label = NameLess(map.x.label, x);
  map.y.label = NameLess(map.y.label, y);
  return map;
}

}  // namespace

std::string NameLess(const std::string& name, double origin) {
  if (origin == 0.0) return name;
  return fmt::format("{} {} {:.0f}", name, origin > 0.0 ? "less" : "and", std::fabs(origin));
}

std::string MapSvg(const Map& of) {
  const Map map = AboutItself(of);
  const ColorScale scale = ScaleFor(map);
  const double span_x = map.x_high - map.x_low, span_y = map.y_high - map.y_low;
  if (!(span_x > 0.0) || !(span_y > 0.0) || map.panes.empty()) {
    throw Error("has no extent or no pane", "report: map \"" + map.title + "\"",
                "give low below high and at least one pane");
  }
  const double height = std::clamp(kPane * span_y / span_x, 0.3 * kPane, 2.0 * kPane);
  const double step = kPane + kGap;
  const double width = kMapLeft + step * static_cast<double>(map.panes.size());
  const double whole = kMapTop + height + kMapBottom + kBar;
  std::string svg = fmt::format(
      "<div class=\"drawing\"><svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" role=\"img\" "
      "aria-label=\"{2}\">\n",
      width, whole, EscapeHtml(map.title));
  const auto X = [&](double left, double x) { return left + kPane * (x - map.x_low) / span_x; };
  const auto Y = [&](double y) { return kMapTop + height * (map.y_high - y) / span_y; };
  for (std::size_t k = 0; k < map.panes.size(); ++k) {
    const MapPane& pane = map.panes[k];
    const double left = kMapLeft + step * static_cast<double>(k);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"15\">{}</text>\n", left, EscapeHtml(pane.title));
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"#eceff3\" "
        "stroke=\"#566072\"/>\n",
        left, kMapTop, kPane, height);
    svg += Cells(map, pane, scale, left, height);
    for (const MapDot& dot : pane.dots) {
      svg += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" stroke=\"#1c2430\" "
          "stroke-width=\"0.6\"><title>{}</title></circle>",
          X(left, dot.x), Y(dot.y), dot.large ? 6 : 3.6,
          std::isfinite(dot.value) ? ScaleColor(scale.Share(dot.value)) : "#ffffff",
          EscapeHtml(dot.label));
    }
    svg += "\n";
    for (const double tick : Ticks(map.x_low, map.x_high, 5)) {
      svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>",
                         X(left, tick), kMapTop + height + 16.0, Number(tick, 2));
    }
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                       left + 0.5 * kPane, kMapTop + height + 34.0, EscapeHtml(AxisTitle(map.x)));
  }
  for (const double tick : Ticks(map.y_low, map.y_high, 5)) {
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>",
                       kMapLeft - 6.0, Y(tick) + 4.0, Number(tick, 2));
  }
  svg += fmt::format(
      "<text x=\"12\" y=\"{0:.1f}\" text-anchor=\"middle\" transform=\"rotate(-90 12 "
      "{0:.1f})\">{1}</text>\n",
      kMapTop + 0.5 * height, EscapeHtml(AxisTitle(map.y)));
  const double bar_y = kMapTop + height + kMapBottom;
  svg += ScaleBar(scale, map.value, kMapLeft, bar_y, kPane) + "</svg></div>\n";
  return svg;
}

}  // namespace unfurl::report
