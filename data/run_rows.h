#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "data/h5.h"

namespace unfurl::data {

// Rows of a run's datasets. A run that did not end may have lengths that differ: it is read as far
// as all of them go, and as far as was written.

inline constexpr std::size_t kRunBlockRows = 65536;  // samples in memory at once

// Of all these. Throws Error where they differ in a run that ended.
std::size_t CommonRows(const H5Reader& file, const std::vector<std::string>& datasets, bool ended);

// Of a run that did not end: rows before the first without a number, which was never written. It is
// sought among the last alone: what came before the last flush is there.
std::size_t WrittenRows(const H5Reader& file, const std::string& at, std::size_t rows);

}  // namespace unfurl::data
