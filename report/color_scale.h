#pragma once

#include <string>
#include <vector>

#include "report/page.h"

namespace unfurl::report {

// A scale of colours: a value's share of it, linear or, where the Axis says so and all is above
// zero, logarithmic.
struct ColorScale {
  double low = 0.0, high = 1.0;  // high above low
  bool log = false;

  double Share(double value) const;  // in [0, 1]
  double Value(double share) const;
};

// Of these values (NaN are passed over); `low` and `high` replace the ends where they are not NaN.
ColorScale ScaleOf(const std::vector<double>& values, bool log, double low, double high);

// "#rrggbb" of `share` in [0, 1] on a scale that is even to the eye and rises in lightness,
// distinguishable apart by colour-blind readers and in grey (viridis).
std::string ScaleColor(double share);

// The scale as SVG, `width` wide, with numbers and the axis' title beneath: 48 high.
std::string ScaleBar(const ColorScale& scale, const Axis& axis, double x, double y, double width);

}  // namespace unfurl::report
