#pragma once

#include <string>

#include "report/page.h"

namespace unfurl::report {

// The map as inline SVG: its panes side by side, a scale of colours beneath. Throws Error for panes
// whose values do not fill their grid.
std::string MapSvg(const Map& map);

}  // namespace unfurl::report
