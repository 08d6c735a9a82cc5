#pragma once

#include <span>
#include <string>
#include <vector>

#include "data/h5.h"
#include "data/line_format.h"

namespace unfurl::data {

// Dimensions of one row of lines in a file: camera x element, or, where the cameras' lines differ,
// the elements of all of them in turn.
std::vector<std::size_t> LineDims(const LineFormats& formats, std::size_t cameras);

// The layout: attributes of `object`, the dataset of the lines; where the cameras differ, datasets
// in the group /line_formats.
void WriteLineFormats(H5Writer& writer, const std::string& object, const LineFormats& formats);
// Throws Error when an entry is missing or impossible, or when the lines do not fit it.
LineFormats ReadLineFormats(const H5Reader& reader, const std::string& object, std::size_t cameras);

// A flat field, camera after camera, an entry for each active pixel: the dataset /response, there
// only where one was recorded.
void WriteResponse(H5Writer& writer, std::span<const float> response, std::size_t cameras,
                   const LineFormats& formats);
std::vector<float> ReadResponse(const H5Reader& reader, std::size_t cameras,
                                const LineFormats& formats);

}  // namespace unfurl::data
