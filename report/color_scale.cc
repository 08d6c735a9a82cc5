#include "report/color_scale.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/number.h"
#include "report/chart.h"
#include "report/escape.h"

namespace unfurl::report {

double ColorScale::Share(double value) const {
  const double share =
      log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  return std::clamp(share, 0.0, 1.0);
}

double ColorScale::Value(double share) const {
  return log ? low * std::pow(high / low, share) : low + share * (high - low);
}

ColorScale ScaleOf(const std::vector<double>& values, bool log, double least, double most) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (!std::isfinite(value) || (log && value <= 0.0)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (!(low <= high)) low = high = 1.0;
  if (std::isfinite(most)) high = most;
  if (std::isfinite(least)) low = least;
  if (!(high > low)) high = low + std::max(1e-12, std::abs(low));
  return {low, high, log && low > 0.0};
}

std::string ScaleColor(double share) {
  static constexpr std::array<std::array<int, 3>, 9> kAnchors = {{{68, 1, 84},
                                                                  {71, 44, 122},
                                                                  {59, 81, 139},
                                                                  {44, 113, 142},
                                                                  {33, 144, 141},
                                                                  {39, 173, 129},
                                                                  {92, 200, 99},
                                                                  {170, 220, 50},
                                                                  {253, 231, 37}}};
  const double at = std::clamp(share, 0.0, 1.0) * 8.0;
  const auto k = std::min<std::size_t>(7, static_cast<std::size_t>(at));
  const double f = at - static_cast<double>(k);
  std::array<int, 3> rgb;
  for (std::size_t c = 0; c < 3; ++c) {
    rgb[c] = static_cast<int>(std::lround((1.0 - f) * kAnchors[k][c] + f * kAnchors[k + 1][c]));
  }
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

std::string ScaleBar(const ColorScale& scale, const Axis& axis, double x, double y, double width) {
  std::string svg;
  constexpr int kSteps = 60;  // of colour: too fine to be seen
  for (int k = 0; k < kSteps; ++k) {
    svg += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"12\" fill=\"{}\"/>",
        x + width * k / kSteps, y, width / kSteps + 0.4, ScaleColor((k + 0.5) / kSteps));
  }
  for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>",
                       x + width * share, y + 27.0, Number(scale.Value(share), 2));
  }
  return svg + fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                           x + 0.5 * width, y + 44.0, EscapeHtml(AxisTitle(axis)));
}

}  // namespace unfurl::report
