#include "report/terminal_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "base/error.h"

namespace unfurl::report {

namespace {

constexpr int kAcross = 2, kDown = 4;  // points of a braille pattern
constexpr int kLabel = 10;             // characters of a number left of the axis
constexpr int kLeast = 2;              // characters and rows of a picture at least

struct Range {
  double low = 0.0, high = 0.0;
  bool some = false;
  void Add(double value) {
    low = some ? std::min(low, value) : value;
    high = some ? std::max(high, value) : value;
    some = true;
  }
  // A flat curve runs in the middle.
  double Place(double value) const {
    // Halves, since a span may overflow where its ends do not.
    const double span = 0.5 * high - 0.5 * low;
    return span > 0.0 ? (0.5 * value - 0.5 * low) / span : 0.5;
  }
};

class Canvas {
 public:
  Canvas(int columns, int rows)
      : columns_(columns),
        rows_(rows),
        dots_(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)) {}

  int width() const { return kAcross * columns_; }
  int height() const { return kDown * rows_; }

  // From the top left.
  void Set(int x, int y) {
    // Bits of Unicode's braille patterns, by row and column of their points.
    static constexpr unsigned kBits[kDown][kAcross] = {
        {0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
    dots_[Index(x / kAcross, y / kDown)] |= kBits[y % kDown][x % kAcross];
  }

  // Bresenham's line.
  void Line(int x0, int y0, int x1, int y1) {
    const int dx = std::abs(x1 - x0), dy = -std::abs(y1 - y0);
    const int step_x = x0 < x1 ? 1 : -1, step_y = y0 < y1 ? 1 : -1;
    for (int error = dx + dy;;) {
      Set(x0, y0);
      if (x0 == x1 && y0 == y1) return;
      const int twice = 2 * error;
      if (twice >= dy) error += dy, x0 += step_x;
      if (twice <= dx) error += dx, y0 += step_y;
    }
  }

  std::string Row(int row) const {
    std::string out;
    for (int column = 0; column < columns_; ++column) {
      const unsigned code = 0x2800 + dots_[Index(column, row)];
      out += static_cast<char>(0xe0 | (code >> 12));
      out += static_cast<char>(0x80 | ((code >> 6) & 0x3f));
      out += static_cast<char>(0x80 | (code & 0x3f));
    }
    return out;
  }

 private:
  std::size_t Index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }
  int columns_, rows_;
  std::vector<unsigned> dots_;
};

void Draw(const TerminalPlot& plot, std::span<const double> x, std::span<const double> y,
          const Range& across, const Range& up, Canvas* canvas) {
  int before_x = 0, before_y = 0;
  bool before = false;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const bool here = std::isfinite(x[i]) && std::isfinite(y[i]);
    if (here) {
      const int px = static_cast<int>(std::lround(across.Place(x[i]) * (canvas->width() - 1)));
      const int py =
          static_cast<int>(std::lround((1.0 - up.Place(y[i])) * (canvas->height() - 1)));
      if (plot.joined && before) {
        canvas->Line(before_x, before_y, px, py);
      } else {
        canvas->Set(px, py);
      }
      before_x = px, before_y = py;
    }
    before = here;
  }
}

std::string Number(double value) {
  std::string text = fmt::format("{:.4g}", value);
  return text == "-0" ? "0" : text;
}

}  // namespace

std::string TerminalText(const TerminalPlot& plot, std::span<const double> x,
                         std::span<const double> y) {
  if (x.size() != y.size()) throw Error("x and y differ in length", plot.title, "give pairs");
  Range across, up;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    across.Add(x[i]);
    up.Add(y[i]);
  }
  if (!across.some) return fmt::format("{}: nothing to draw\n", plot.title);
  Canvas canvas(std::max(plot.columns - kLabel - 1, kLeast), std::max(plot.rows, kLeast));
  Draw(plot, x, y, across, up, &canvas);
  const int rows = canvas.height() / kDown, columns = canvas.width() / kAcross;
  std::string out = fmt::format("{:{}} {}\n", "", kLabel, plot.title);
  for (int row = 0; row < rows; ++row) {
    std::string label;
    if (row == 0) label = Number(up.high);
    if (row == rows - 1 && up.low != up.high) label = Number(up.low);
    out += fmt::format("{:>{}}\u2524{}\n", label, kLabel, canvas.Row(row));
  }
  const std::string from = Number(across.low), to = Number(across.high) + " " + plot.x_title;
  const int gap = std::max(1, columns - static_cast<int>(from.size() + to.size()));
  out += fmt::format("{:{}} {}{:{}}{}\n", "", kLabel, from, "", gap, to);
  return out;
}

}  // namespace unfurl::report
