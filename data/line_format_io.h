#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "data/h5.h"
#include "data/line_format.h"

namespace unfurl::data {

inline constexpr int kMostOtherElements = 1000;  // of a kind that is not active, of any sensor
inline constexpr int kFewestActive = 16, kMostActive = 100000;  // as the lab's file is checked
// Of a pixel's response to the mean [-]: beyond, it is broken or the record is.
inline constexpr double kLowestResponse = 0.05, kHighestResponse = 20.0;

// What a format's whole numbers are called, with their bounds.
struct LineFormatWhole {
  const char* name;
  int LineFormat::*member;
  int low, high;
};
inline constexpr std::array<LineFormatWhole, 6> kLineFormatWhole = {
    {{"dummy", &LineFormat::dummy, 0, kMostOtherElements},
     {"dark", &LineFormat::dark, 0, kMostOtherElements},
     {"active", &LineFormat::active, kFewestActive, kMostActive},
     {"dark_after", &LineFormat::dark_after, 0, kMostOtherElements},
     {"parity", &LineFormat::parity, 0, kMostOtherElements},
     {"bits", &LineFormat::bits, 1, 16}}};
// The same of its other numbers.
struct LineFormatReal {
  const char *name, *unit;
  double LineFormat::*member;
  bool zero;  // is allowed
};
inline constexpr std::array<LineFormatReal, 3> kLineFormatReal = {
    {{"pitch", "m", &LineFormat::pitch, false},
     {"electrons_per_count", "e-/count", &LineFormat::electrons_per_count, false},
     {"read_noise_counts", "count", &LineFormat::read_noise_counts, true}}};

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
