#pragma once

#include <string>

#include "report/page.h"

namespace unfurl::report {

// The chart as one SVG document for a paper or a slide: axes with ticks (logarithmic where the Axis
// says so), grid, legend, markers; measured data as dots with their band, computed data as lines.
// Throws Error for arrays that do not fit together, as a page does.
std::string StillSvg(const Chart& chart, int width_px = 720, int height_px = 420);

}  // namespace unfurl::report
