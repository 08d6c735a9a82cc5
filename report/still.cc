#include "report/still.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "report/chart.h"
#include "report/escape.h"
#include "report/paths.h"

namespace unfurl::report {
namespace {

// Room for the axes' numbers and titles [px].
constexpr double kRoomLeft = 72.0, kRoomRight = 18.0, kRoomBottom = 52.0;
constexpr double kRow = 18.0;        // of the legend
constexpr double kStillStep = 0.35;  // points nearer than this to the last one add nothing [px]

// One axis: values to pixels.
class Scale {
 public:
  Scale(const Axis& axis, double from_px, double to_px)
      : log_(axis.log), from_(from_px), to_(to_px) {}

  void Add(double v) {
    if (!std::isfinite(v) || (log_ && v <= 0.0)) return;
    low_ = std::min(low_, v);
    high_ = std::max(high_, v);
  }
  bool empty() const { return !(low_ <= high_); }
  void Pad(double part) {
    if (log_) {
      low_ = std::pow(10.0, std::floor(std::log10(low_)));
      high_ = std::pow(10.0, std::ceil(std::log10(high_)));
      if (high_ <= low_) high_ = 10.0 * low_;
      return;
    }
    const double air = std::max(part * (high_ - low_), 1e-12 + 1e-9 * std::abs(high_));
    low_ -= air;
    high_ += air;
  }
  double operator()(double v) const {
    const double u = log_ ? std::log10(std::max(v, low_) / low_) / std::log10(high_ / low_)
                          : (v - low_) / (high_ - low_);
    return from_ + u * (to_ - from_);
  }
  bool Shows(double v) const { return std::isfinite(v) && (!log_ || v > 0.0); }
  std::vector<double> Marks(int count) const {
    if (!log_) return Ticks(low_, high_, count);
    std::vector<double> out;
    double v = low_;
    while (v <= 1.0001 * high_) {
      out.push_back(v);
      v *= 10.0;
    }
    return out;
  }

 private:
  bool log_;
  double from_, to_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
};

std::string Word(double value, double step) {
  if (std::abs(value) < 1e-9 * step) return "0";
  const std::string digits = fmt::format("{:.6g}", std::abs(value));
  return value < 0.0 ? "\u2212" + digits : digits;
}

std::string Curve(const Series& s, const Scale& X, const Scale& Y, const std::string& color) {
  std::string path, dots;
  double last_x = -1e9, last_y = -1e9;
  bool down = false;
  for (std::size_t i = 0; i < s.x.size(); ++i) {
    if (!X.Shows(s.x[i]) || !Y.Shows(s.y[i])) {
      down = false;
      continue;
    }
    const double x = X(s.x[i]), y = Y(s.y[i]);
    if (down && std::hypot(x - last_x, y - last_y) < kStillStep) continue;
    if (s.style == Style::kDots) {
      dots += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.4\"/>", x, y);
    } else {
      path += fmt::format("{}{:.1f} {:.1f}", down ? 'L' : 'M', x, y);
    }
    down = true;
    last_x = x;
    last_y = y;
  }
  if (s.style == Style::kDots) return fmt::format("<g fill=\"{}\">{}</g>\n", color, dots);
  return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.4\"{}/>\n", path,
                     color, s.style == Style::kDashes ? " stroke-dasharray=\"6 4\"" : "");
}

std::string Band(const Series& s, const Scale& X, const Scale& Y, const std::string& color) {
  if (s.half_width.empty()) return {};
  std::string there, back;
  for (std::size_t i = 0; i < s.x.size(); ++i) {
    const double low = s.y[i] - s.half_width[i], high = s.y[i] + s.half_width[i];
    if (!X.Shows(s.x[i]) || !Y.Shows(low) || !Y.Shows(high)) continue;
    there += fmt::format("{}{:.1f} {:.1f}", there.empty() ? 'M' : 'L', X(s.x[i]), Y(high));
    back.insert(0, fmt::format("L{:.1f} {:.1f}", X(s.x[i]), Y(low)));
  }
  return fmt::format("<path d=\"{}{}Z\" fill=\"{}\" fill-opacity=\"0.18\"/>\n", there, back, color);
}

// Dashed lines with upright words; words of neighbours stand one below the other.
std::string Markers(const Chart& chart, const Scale& X, double top, double width, double height) {
  std::string svg;
  std::vector<Marker> markers = chart.markers;
  std::stable_sort(markers.begin(), markers.end(),
                   [](const Marker& a, const Marker& b) { return a.x < b.x; });
  double last_x = -1e9, down = 0.0;
  for (const Marker& m : markers) {
    if (!X.Shows(m.x) || X(m.x) < kRoomLeft || X(m.x) > width - kRoomRight) continue;
    constexpr double kApart = 12.0, kLetter = 6.0;  // a label's height, a letter's width [px]
    const double previous = down;
    down = X(m.x) - last_x < kApart ? previous : 0.0;
    last_x = X(m.x);
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#888\" stroke-dasharray=\"3 3\"/><text "
        "x=\"{3:.1f}\" y=\"{4:.1f}\" font-size=\"10\" fill=\"#555\" transform=\"rotate(-90 {3:.1f} "
        "{4:.1f})\" text-anchor=\"end\">{5}</text>\n",
        X(m.x), top, height - kRoomBottom, X(m.x) - 3, top + 4 + down, EscapeHtml(m.label));
    down += kLetter * static_cast<double>(m.label.size()) + 6.0;
  }
  return svg;
}

// The series, and their names in two columns above the plot.
std::string CurvesWithKey(const Chart& chart, const Scale& X, const Scale& Y, double width) {
  std::string svg;
  double key_x = kRoomLeft, key_y = 38.0;
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    const Series& s = chart.series[k];
    const std::string color = PaletteColor(s.color >= 0 ? s.color : static_cast<int>(k));
    svg += Band(s, X, Y, color) + Curve(s, X, Y, color);
    svg += s.style == Style::kDots
               ? fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"{}\"/>",
                             key_x + 12, key_y - 4, color)
               : fmt::format("<path d=\"M{:.1f} {:.1f}h24\" stroke=\"{}\" stroke-width=\"2\"{}/>",
                             key_x, key_y - 4, color,
                             s.style == Style::kDashes ? " stroke-dasharray=\"6 4\"" : "");
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", key_x + 30, key_y,
                       EscapeHtml(s.name));
    key_x = k % 2 == 0 ? 0.5 * (kRoomLeft + width) : kRoomLeft;
    if (k % 2 == 1) key_y += kRow;
  }
  return svg;
}

}  // namespace

std::string StillSvg(const Chart& chart, int width_px, int height_px) {
  ChartJson(chart);  // its checks are ours
  const double width = width_px, height = height_px;
  const std::size_t legend_rows = (chart.series.size() + 1) / 2;
  const double top = 34.0 + kRow * static_cast<double>(legend_rows);
  Scale X(chart.x, kRoomLeft, width - kRoomRight), Y(chart.y, height - kRoomBottom, top);
  for (const Series& s : chart.series) {
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!X.Shows(s.x[i]) || !Y.Shows(s.y[i])) continue;
      X.Add(s.x[i]);
      Y.Add(s.y[i]);
    }
  }
  if (X.empty() || Y.empty()) {
    throw Error("a figure without data", "report: chart \"" + chart.title + "\"",
                "give at least one point that the axes can show");
  }
  X.Pad(0.0);
  Y.Pad(0.05);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
      "{1}\" font-family=\"Helvetica, Arial, DejaVu Sans, sans-serif\" font-size=\"13\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n"
      "<text x=\"{2:.1f}\" y=\"20\" font-size=\"15\" font-weight=\"bold\">{3}</text>\n",
      width_px, height_px, kRoomLeft, EscapeHtml(chart.title));
  const std::vector<double> xs = X.Marks(static_cast<int>((width - kRoomLeft) / 90)),
                            ys = Y.Marks(static_cast<int>((height - top) / 50));
  const double x_step = xs.size() > 1 ? xs[1] - xs[0] : 1.0;
  const double y_step = ys.size() > 1 ? ys[1] - ys[0] : 1.0;
  for (const double x : xs) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#e2e2e2\"/><text x=\"{0:.1f}\" "
        "y=\"{3:.1f}\" "
        "text-anchor=\"middle\">{4}</text>\n",
        X(x), top, height - kRoomBottom, height - kRoomBottom + 18, Word(x, x_step));
  }
  for (const double y : ys) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#e2e2e2\"/><text x=\"{3:.1f}\" "
        "y=\"{4:.1f}\" "
        "text-anchor=\"end\">{5}</text>\n",
        kRoomLeft, Y(y), width - kRoomRight, kRoomLeft - 6, Y(y) + 4, Word(y, y_step));
  }
  svg += Markers(chart, X, top, width, height);
  svg += CurvesWithKey(chart, X, Y, width);
  svg += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" "
      "stroke=\"#555\"/>\n<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n"
      "<text transform=\"translate(18 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
      kRoomLeft, top, width - kRoomLeft - kRoomRight, height - top - kRoomBottom,
      0.5 * (kRoomLeft + width - kRoomRight), height - 14, EscapeHtml(AxisTitle(chart.x)),
      0.5 * (top + height - kRoomBottom), EscapeHtml(AxisTitle(chart.y)));
  return svg + "</svg>\n";
}

}  // namespace unfurl::report
