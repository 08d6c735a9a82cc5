#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/h5.h"
#include "data/line_format.h"

namespace unfurl::data {

// The layout as attributes of `object` (the dataset or group of the lines).
void WriteLineFormat(H5Writer& writer, const std::string& object, const LineFormat& format);
// Throws Error when an entry is missing or impossible, or when the lines, whose last dimension is
// `elements`, do not fit it.
LineFormat ReadLineFormat(const H5Reader& reader, const std::string& object, std::size_t elements);

// A flat field, c x active: the dataset /response, there only where one was recorded.
void WriteResponse(H5Writer& writer, std::span<const float> response, std::size_t cameras,
                   const LineFormat& format);
std::vector<float> ReadResponse(const H5Reader& reader, std::size_t cameras,
                                const LineFormat& format);

}  // namespace unfurl::data
