#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace unfurl::report {

// Indices of at most `most` values (4 or more), rising: the first and the last, and of every
// stretch between the least and the largest, so that no peak is lost; a gap (NaN) stays one. All of
// them where they are no more.
std::vector<std::size_t> LeastAndMost(std::span<const double> values, std::size_t most);

}  // namespace unfurl::report
