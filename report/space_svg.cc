#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "report/chart.h"
#include "report/escape.h"
#include "report/space_parts.h"

namespace unfurl::report {
namespace {

// Of the drawing, in its own units (px at full width).
constexpr double kSpaceWidth = 1000.0, kHeight = 600.0, kMargin = 34.0, kBars = 62.0;
// Where one looks from: to the right of the front, from above. space_view.js begins there too.
constexpr double kAzimuth = -60.0 * std::numbers::pi / 180.0;   // [rad]
constexpr double kElevation = 25.0 * std::numbers::pi / 180.0;  // [rad]

double Dot(const Place& a, const Place& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Seen along parallels: to the right, up, and towards the reader.
const Place kToRight = {-std::sin(kAzimuth), std::cos(kAzimuth), 0.0};
const Place kUp = {-std::sin(kElevation) * std::cos(kAzimuth),
                   -std::sin(kElevation) * std::sin(kAzimuth), std::cos(kElevation)};
const Place kNear = {std::cos(kElevation) * std::cos(kAzimuth),
                     std::cos(kElevation) * std::sin(kAzimuth), std::sin(kElevation)};

std::vector<Place> Corners(const Space& space) {
  std::vector<Place> out;
  for (std::size_t k = 0; k < 8; ++k) {
    out.push_back({(k & 1) != 0 ? space.high[0] : space.low[0],
                   (k & 2) != 0 ? space.high[1] : space.low[1],
                   (k & 4) != 0 ? space.high[2] : space.low[2]});
  }
  return out;
}

class SpaceDrawing {
 public:
  explicit SpaceDrawing(const Space& space) {
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
    const auto add = [&](const Place& p) {
      const double at[2] = {Dot(p, kToRight), Dot(p, kUp)};
      for (int k = 0; k < 2; ++k) {
        low[k] = std::min(low[k], at[k]);
        high[k] = std::max(high[k], at[k]);
      }
    };
    for (const Place& corner : Corners(space)) add(corner);
    for (const SpaceEye& eye : space.eyes) {
      add(eye.at);
      for (const Place& corner : eye.field) add(corner);
    }
    const double wide = high[0] - low[0], tall = high[1] - low[1];
    scale_ = std::min((kSpaceWidth - 2.0 * kMargin) / wide, (kHeight - 2.0 * kMargin) / tall);
    x0_ = 0.5 * kSpaceWidth - 0.5 * scale_ * (low[0] + high[0]);
    y0_ = kMargin + scale_ * high[1];
    height_ = scale_ * tall + 2.0 * kMargin;
  }

  double height() const { return height_; }
  double X(const Place& p) const { return x0_ + scale_ * Dot(p, kToRight); }
  double Y(const Place& p) const { return y0_ - scale_ * Dot(p, kUp); }

  std::string Segment(const Place& a, const Place& b, const char* style) const {
    return fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>", X(a), Y(a), X(b), Y(b),
                       style);
  }

  std::string Word(const Place& at, double right, double down, const std::string& text) const {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                       X(at) + right, Y(at) + down, EscapeHtml(text));
  }

  // The outline of an ellipsoid of semi-axes a: seen along parallels it is the ellipse of the 2 x 2
  // matrix sum q q', q the axes in the picture.
  std::string Outline(const SpaceEllipsoid& one, double times, const std::string& color) const {
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (const Place& axis : one.axes) {
      const double x = times * scale_ * Dot(axis, kToRight), y = -times * scale_ * Dot(axis, kUp);
      xx += x * x;
      xy += x * y;
      yy += y * y;
    }
    const double mean = 0.5 * (xx + yy), part = std::hypot(0.5 * (xx - yy), xy);
    return fmt::format(
        "<ellipse rx=\"{:.2f}\" ry=\"{:.2f}\" transform=\"translate({:.1f} {:.1f}) "
        "rotate({:.1f})\" fill=\"{}\" stroke=\"#333\" stroke-width=\"0.4\"/>",
        std::sqrt(mean + part), std::sqrt(std::max(mean - part, 0.0)), X(one.at), Y(one.at),
        0.5 * std::atan2(2.0 * xy, xx - yy) * 180.0 / std::numbers::pi, color);
  }

 private:
  double scale_ = 1.0, x0_ = 0.0, y0_ = 0.0, height_ = kHeight;
};

std::string BoxWithAxes(const Space& space, const SpaceDrawing& drawing) {
  const std::vector<Place> corner = Corners(space);
  std::string svg;
  for (std::size_t k = 0; k < 8; ++k) {
    for (const std::size_t bit : {1U, 2U, 4U}) {
      if ((k & bit) == 0) svg += drawing.Segment(corner[k], corner[k | bit], "stroke=\"#9aa3b0\"");
    }
  }
  svg += "\n";
  constexpr const char* kNames[] = {"x", "y", "z"};
  // Along the edges nearest to the reader below, and the one at the left.
  constexpr std::array<std::array<std::size_t, 2>, 3> kEdges = {{{0, 1}, {1, 3}, {0, 4}}};
  for (std::size_t k = 0; k < 3; ++k) {
    const Place &a = corner[kEdges[k][0]], &b = corner[kEdges[k][1]];
    const double right = k == 2 ? -24.0 : 0.0, down = k == 2 ? 4.0 : 18.0;
    // Where two edges meet, their numbers stand side by side.
    svg += drawing.Word(a, k == 1 ? 26.0 : right, down, fmt::format("{:.2f}", space.low[k]));
    svg += drawing.Word(b, k == 0 ? -16.0 : right, down, fmt::format("{:.2f}", space.high[k]));
    const Place middle = {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])};
    svg += drawing.Word(middle, right, down, fmt::format("{} [{}]", kNames[k], space.unit));
  }
  return svg;
}

std::string Fields(const Space& space, const SpaceDrawing& drawing) {
  std::string svg;
  for (std::size_t e = 0; e < space.eyes.size(); ++e) {
    const SpaceEye& eye = space.eyes[e];
    const char* color = PaletteColor(static_cast<int>(e));
    const std::string style = fmt::format("stroke=\"{}\" stroke-opacity=\"0.5\"", color);
    for (std::size_t k = 0; k < eye.field.size(); ++k) {
      svg += drawing.Segment(eye.at, eye.field[k], style.c_str());
      svg += drawing.Segment(eye.field[k], eye.field[(k + 1) % eye.field.size()], style.c_str());
    }
  }
  return svg + "\n";
}

std::string Curves(const Space& space, const SpaceDrawing& drawing) {
  std::string svg;
  for (const SpaceLine& line : space.lines) {
    std::string path;
    bool down = false;
    for (const Place& at : line.points) {
      const bool there = std::isfinite(Length(at));
      if (there) {
        path += fmt::format("{}{:.1f} {:.1f}", down ? 'L' : 'M', drawing.X(at), drawing.Y(at));
      }
      down = there;
    }
    svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-opacity=\"0.7\"/>\n",
                       path, PaletteColor(line.color));
  }
  return svg;
}

// Points and ellipsoids, the farthest first.
std::string Solids(const Space& space, const SpaceDrawing& drawing) {
  std::vector<std::pair<double, std::string>> parts;
  if (!space.ellipsoids.empty()) {
    const SpaceEllipsoids& set = space.ellipsoids.front();
    const ColorScale scale = ScaleFor(set);
    const double times = Magnification(space);
    for (const SpaceEllipsoid& one : set.ellipsoids) {
      parts.emplace_back(Dot(one.at, kNear),
                         drawing.Outline(one, times, ScaleColor(scale.Share(one.value))));
    }
  }
  if (!space.clouds.empty()) {
    const SpaceCloud& cloud = space.clouds.front();
    const ColorScale scale = ScaleFor(cloud);
    for (const SpacePoint& point : cloud.points) {
      parts.emplace_back(
          Dot(point.at, kNear),
          fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>",
                      drawing.X(point.at), drawing.Y(point.at),
                      std::isfinite(point.value) ? ScaleColor(scale.Share(point.value)) : "#aaa"));
    }
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string svg;
  for (const auto& part : parts) svg += part.second;
  return svg + "\n";
}

}  // namespace

std::string SpaceSvg(const Space& space) {
  CheckSpace(space);
  const SpaceDrawing drawing(space);
  const bool bars = !space.clouds.empty() || !space.ellipsoids.empty();
  const double height = drawing.height() + (bars ? kBars : 0.0);
  std::string svg = fmt::format(
      "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" role=\"img\" "
      "aria-label=\"{2}\">\n",
      kSpaceWidth, height, EscapeHtml(space.title));
  svg += BoxWithAxes(space, drawing) + Fields(space, drawing) + Curves(space, drawing) +
         Solids(space, drawing);
  for (std::size_t e = 0; e < space.eyes.size(); ++e) {
    const SpaceEye& eye = space.eyes[e];
    svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"10\" height=\"10\" fill=\"{}\"/>",
                       drawing.X(eye.at) - 5.0, drawing.Y(eye.at) - 5.0,
                       PaletteColor(static_cast<int>(e)));
    svg += drawing.Word(eye.at, 0.0, -10.0, eye.name);
  }
  const double y = drawing.height() + 4.0;
  if (!space.clouds.empty()) {
    const SpaceCloud& cloud = space.clouds.front();
    Axis axis = cloud.value;
    axis.label = cloud.name + ": " + axis.label;
    svg += ScaleBar(ScaleFor(cloud), axis, 40.0, y, 400.0);
  }
  if (!space.ellipsoids.empty()) {
    const SpaceEllipsoids& set = space.ellipsoids.front();
    Axis axis = set.value;
    axis.label =
        fmt::format("{}, drawn {:g} times: {}", set.name, Magnification(space), axis.label);
    svg += ScaleBar(ScaleFor(set), axis, 560.0, y, 400.0);
  }
  return svg + "</svg>\n";
}

}  // namespace unfurl::report
