#pragma once

#include <string>
#include <vector>

#include "report/page.h"

namespace unfurl::report {

// The paths as inline SVG at equal scale, with ticks, and a legend beneath. Throws Error for a
// path whose x and y differ in length.
std::string PathsSvg(const Paths& paths);

// Round numbers (1, 2 or 5 times a power of ten apart) within [low, high], about `count` of them.
std::vector<double> Ticks(double low, double high, int count);

}  // namespace unfurl::report
