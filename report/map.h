#pragma once

#include <string>

#include "report/page.h"

namespace unfurl::report {

// The map as inline SVG: its panes side by side, a scale of colours beneath. Throws Error for panes
// whose values do not fill their grid.
std::string MapSvg(const Map& map);

// "#rrggbb" of `share` in [0, 1] on a scale that is even to the eye and rises in lightness,
// distinguishable apart by colour-blind readers and in grey (viridis).
std::string ScaleColor(double share);

}  // namespace unfurl::report
