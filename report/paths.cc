#include "report/paths.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "report/chart.h"
#include "report/escape.h"

namespace unfurl::report {
namespace {

constexpr double kWidth = 1000.0;     // of the drawing, in its own units (px at full width)
constexpr double kMaxHeight = 620.0;  // a tall drawing is narrowed instead
// Room for the axes' numbers and titles.
constexpr double kLeft = 64.0, kRight = 16.0, kTop = 12.0, kBottom = 44.0;
constexpr double kMinStep = 0.4;  // points nearer than this to the last one add nothing

struct PathsBox {
  double x_low = std::numeric_limits<double>::infinity();
  double x_high = -std::numeric_limits<double>::infinity();
  double y_low = std::numeric_limits<double>::infinity();
  double y_high = -std::numeric_limits<double>::infinity();

  bool empty() const { return !(x_low <= x_high); }
  void Add(double x, double y) {
    x_low = std::min(x_low, x);
    x_high = std::max(x_high, x);
    y_low = std::min(y_low, y);
    y_high = std::max(y_high, y);
  }
  // Some air around, and never a box without width.
  void Pad() {
    const double margin = std::max(0.04 * std::max(x_high - x_low, y_high - y_low), 1e-9);
    x_low -= margin;
    x_high += margin;
    y_low -= margin;
    y_high += margin;
  }
};

bool Finite(const Path& path, std::size_t i) {
  return std::isfinite(path.x[i]) && std::isfinite(path.y[i]);
}

std::string TickLabel(double value, double step) {
  const int places = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  std::string text = fmt::format("{:.{}f}", std::abs(value) < 0.5 * step ? 0.0 : value, places);
  return text[0] == '-' ? "\u2212" + text.substr(1) : text;
}

class Drawing {
 public:
  explicit Drawing(const PathsBox& box) : box_(box) {
    const double room_x = kWidth - kLeft - kRight;
    const double room_y = kMaxHeight - kTop - kBottom;
    scale_ = std::min(room_x / (box.x_high - box.x_low), room_y / (box.y_high - box.y_low));
    width_ = (box.x_high - box.x_low) * scale_;
    height_ = (box.y_high - box.y_low) * scale_;
  }

  double X(double x) const { return kLeft + (x - box_.x_low) * scale_; }
  double Y(double y) const { return kTop + height_ - (y - box_.y_low) * scale_; }
  double total_width() const { return kLeft + width_ + kRight; }
  double total_height() const { return kTop + height_ + kBottom; }

  std::string Axes(const Paths& paths) const {
    std::string svg;
    const std::vector<double> xs = Ticks(box_.x_low, box_.x_high, static_cast<int>(width_ / 90));
    const std::vector<double> ys = Ticks(box_.y_low, box_.y_high, static_cast<int>(height_ / 60));
    const double x_step = xs.size() > 1 ? xs[1] - xs[0] : 1.0;
    const double y_step = ys.size() > 1 ? ys[1] - ys[0] : 1.0;
    for (const double x : xs) {
      svg += fmt::format(
          "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#e4e4e4\"/>"
          "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\">{4}</text>\n",
          X(x), kTop, kTop + height_, kTop + height_ + 16, TickLabel(x, x_step));
    }
    for (const double y : ys) {
      svg += fmt::format(
          "<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#e4e4e4\"/>"
          "<text x=\"{3:.1f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5}</text>\n",
          kLeft, Y(y), kLeft + width_, kLeft - 6, Y(y) + 4, TickLabel(y, y_step));
    }
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
        "fill=\"none\" stroke=\"#888\"/>\n",
        kLeft, kTop, width_, height_);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                       kLeft + width_ / 2, kTop + height_ + 37, EscapeHtml(AxisTitle(paths.x)));
    svg += fmt::format(
        "<text transform=\"translate(14 {:.1f}) rotate(-90)\" "
        "text-anchor=\"middle\">{}</text>\n",
        kTop + height_ / 2, EscapeHtml(AxisTitle(paths.y)));
    return svg;
  }

  std::string Curve(const Path& path, const std::string& color) const {
    std::string line, dots;
    double last_x = 0.0, last_y = 0.0;
    bool down = false;
    std::ptrdiff_t first = -1, last = -1;
    for (std::size_t i = 0; i < path.x.size(); ++i) {
      if (!Finite(path, i)) {
        down = false;
        continue;
      }
      if (first < 0) first = static_cast<std::ptrdiff_t>(i);
      last = static_cast<std::ptrdiff_t>(i);
      const double x = X(path.x[i]), y = Y(path.y[i]);
      if (down && std::hypot(x - last_x, y - last_y) < kMinStep) continue;
      if (path.style == Style::kDots) {
        dots += fmt::format("M{:.1f} {:.1f}h0", x, y);
      } else {
        line += fmt::format("{}{:.1f} {:.1f}", down ? "L" : "M", x, y);
      }
      last_x = x;
      last_y = y;
      down = true;
    }
    std::string svg;
    if (!line.empty()) {
      svg += fmt::format(
          "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" "
          "stroke-linejoin=\"round\"{}/>\n",
          line, color, path.style == Style::kDashes ? " stroke-dasharray=\"7 4\"" : "");
    }
    if (!dots.empty()) {  // lines of no length with round ends: one element for all dots
      svg += fmt::format(
          "<path d=\"{}\" stroke=\"{}\" stroke-width=\"3\" "
          "stroke-linecap=\"round\" stroke-opacity=\"0.6\"/>\n",
          dots, color);
    }
    if (path.ends && first >= 0) {
      const auto at = [&](std::ptrdiff_t i, const std::string& fill) {
        const auto k = static_cast<std::size_t>(i);
        return fmt::format(
            "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4.5\" fill=\"{}\" "
            "stroke=\"{}\" stroke-width=\"1.6\"/>\n",
            X(path.x[k]), Y(path.y[k]), fill, color);
      };
      svg += at(first, "#ffffff") + at(last, color);
    }
    return svg;
  }

 private:
  PathsBox box_;
  double scale_ = 1.0, width_ = 0.0, height_ = 0.0;
};

}  // namespace

std::vector<double> Ticks(double low, double high, int count) {
  std::vector<double> ticks;
  if (!(high > low) || !std::isfinite(high - low)) return ticks;
  const double rough = (high - low) / std::max(count, 2);
  const double decade = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * decade;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= rough) {
      step = factor * decade;
      break;
    }
  }
  const double slack = 1e-9 * step;
  for (double k = std::ceil((low - slack) / step); k * step <= high + slack; k += 1.0) {
    ticks.push_back(k * step);
  }
  return ticks;
}

std::string PathsSvg(const Paths& paths) {
  PathsBox box;
  for (const Path& path : paths.paths) {
    if (path.x.size() != path.y.size()) {
      throw Error(fmt::format("{} x for {} y", path.x.size(), path.y.size()),
                  "report: paths \"" + paths.title + "\", \"" + path.name + "\"",
                  "give both one length");
    }
    for (std::size_t i = 0; i < path.x.size(); ++i) {
      if (Finite(path, i)) box.Add(path.x[i], path.y[i]);
    }
  }
  if (box.empty()) return "<p class=\"note\">No data.</p>\n";
  box.Pad();
  const Drawing drawing(box);
  std::string legend = "<div class=\"legend\">";
  std::string curves;
  for (std::size_t k = 0; k < paths.paths.size(); ++k) {
    const Path& path = paths.paths[k];
    const std::string color = PaletteColor(path.color >= 0 ? path.color : static_cast<int>(k));
    curves += drawing.Curve(path, color);
    legend += "<span class=\"key\">" + LegendSwatch(path.style, color, false) +
              EscapeHtml(path.name) + "</span>";
  }
  legend += "</div>\n";
  return legend +
         fmt::format(
             "<div class=\"drawing\"><svg width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 "
             "{0:.0f} {1:.0f}\" "
             "role=\"img\" aria-label=\"{2}\">\n",
             drawing.total_width(), drawing.total_height(), EscapeHtml(paths.title)) +
         drawing.Axes(paths) + curves + "</svg></div>\n";
}

}  // namespace unfurl::report
