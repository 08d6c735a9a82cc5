#pragma once

#include <vector>

namespace unfurl::sim {

/// Slopes of the monotone cubic at its points [unit of y per unit of x]; two points or more, `x`
/// rising. A file of its own, compiled without -fno-trapping-math: with it, chords that are zero are
/// divided by before they are left out.
std::vector<double> MonotoneSlopes(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace unfurl::sim
