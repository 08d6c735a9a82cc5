#pragma once

#include <string>

#include "report/page.h"

namespace unfurl::report {

// Values of all series of a chart together that are drawn: half a megabyte of page, and of each of
// twenty series more than a screen has columns.
inline constexpr std::size_t kMostValues = 30'000;

// The chart's figure element: title, note, a legend that also prints, the plot's place and its
// data. `id` is unique on the page. Of more than `most` values the least and the largest of short
// stretches are kept. Throws Error for arrays that do not fit together.
std::string ChartHtml(const Chart& chart, const std::string& id, std::size_t most = kMostValues);

// Throws Error for arrays that do not fit together.
void CheckChart(const Chart& chart);

// The chart's data as JSON, rounded to what a picture can show: y to a hundred-thousandth of the
// chart's range (to six digits on a logarithmic axis), bands to three digits; NaN as null. Arrays
// of x that are alike are stored once.
std::string ChartJson(const Chart& chart, std::size_t most = kMostValues);

// Colour `index` of the palette (modulo its length), "#rrggbb". Okabe and Ito's set,
// distinguishable by colour-blind readers, without its yellow, which is lost on white.
const char* PaletteColor(int index);

// A short piece of SVG that shows a style beside a name.
std::string LegendSwatch(Style style, const std::string& color, bool band);

std::string AxisTitle(const Axis& axis);  // "time [s]"

}  // namespace unfurl::report
