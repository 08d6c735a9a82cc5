#pragma once

#include <string>

#include "data/h5.h"
#include "data/line_format.h"

namespace unfurl::data {

// The layout as attributes of `object` (the dataset or group of the lines).
void WriteLineFormat(H5Writer& writer, const std::string& object, const LineFormat& format);
// Throws Error when an entry is missing or impossible, or when the lines, whose last dimension is
// `elements`, do not fit it.
LineFormat ReadLineFormat(const H5Reader& reader, const std::string& object, std::size_t elements);

}  // namespace unfurl::data
