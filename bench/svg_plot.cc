#include "bench/svg_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "report/chart.h"
#include "report/escape.h"
#include "report/paths.h"

namespace unfurl::bench {
namespace {

constexpr double kWidth = 820.0, kHeight = 320.0, kLeft = 78.0, kRight = 16.0, kTop = 30.0,
                 kBottom = 62.0;
constexpr double kMinStep = 0.35;  // points nearer than this add nothing

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void Add(double v) { low = std::min(low, v), high = std::max(high, v); }
};

}  // namespace

void WriteSvg(const std::string& path, const Plot& plot) {
  Range xs, ys;
  for (const Curve& curve : plot.curves) {
    for (const double x : curve.x) xs.Add(x);
    for (const double y : curve.y) ys.Add(y);
  }
  const double margin = 0.05 * std::max(ys.high - ys.low, 1e-12);
  ys.low -= margin, ys.high += margin;
  const double width = kWidth - kLeft - kRight, height = kHeight - kTop - kBottom;
  const auto X = [&](double x) { return kLeft + (x - xs.low) / (xs.high - xs.low) * width; };
  const auto Y = [&](double y) { return kTop + (ys.high - y) / (ys.high - ys.low) * height; };
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" "
      "font-size=\"12\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
      "<text x=\"{2}\" y=\"18\" font-size=\"14\">{3}</text>\n",
      kWidth, kHeight, kLeft, report::EscapeHtml(plot.title));
  for (const double x : report::Ticks(xs.low, xs.high, 8)) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#e4e4e4\"/>"
        "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4:g}</text>\n",
        X(x), kTop, kTop + height, kTop + height + 16, std::fabs(x) < 1e-12 ? 0.0 : x);
  }
  for (const double y : report::Ticks(ys.low, ys.high, 6)) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#e4e4e4\"/>"
        "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n",
        kLeft, Y(y), kLeft + width, kLeft - 6, Y(y) + 4, std::fabs(y) < 1e-12 ? 0.0 : y);
  }
  svg += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
      "stroke=\"#888\"/>\n<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n"
      "<text transform=\"translate(16 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
      kLeft, kTop, width, height, kLeft + width / 2, kTop + height + 34,
      report::EscapeHtml(plot.x_label), kTop + height / 2, report::EscapeHtml(plot.y_label));
  double at = kLeft;
  for (std::size_t c = 0; c < plot.curves.size(); ++c) {
    const Curve& curve = plot.curves[c];
    const char* color = report::PaletteColor(static_cast<int>(c));
    const char* dash = curve.dashed ? " stroke-dasharray=\"6 4\"" : "";
    std::string line;
    double last_x = -1e9, last_y = -1e9;
    for (std::size_t k = 0; k < curve.x.size(); ++k) {
      const double x = X(curve.x[k]), y = Y(curve.y[k]);
      if (std::hypot(x - last_x, y - last_y) < kMinStep) continue;
      line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x, y);
      last_x = x, last_y = y;
    }
    svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\"{}/>\n",
                       line, color, dash);
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}h24\" stroke=\"{2}\" stroke-width=\"2\"{3}/>"
        "<text x=\"{4:.1f}\" y=\"{5:.1f}\">{6}</text>\n",
        at, kHeight - 12, color, dash, at + 30, kHeight - 8, report::EscapeHtml(curve.name));
    at += 46 + 7.2 * static_cast<double>(curve.name.size());
  }
  svg += "</svg>\n";
  std::ofstream out(path, std::ios::binary);
  out << svg;
  if (!out.flush()) throw Error("cannot be written", path, "give a folder that exists");
}

}  // namespace unfurl::bench
