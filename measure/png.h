#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace unfurl::measure {

// A grey picture as a frame grabber writes it: the numbers of the file, with no gamma or scale
// applied.
struct GreyPicture {
  std::size_t rows = 0, columns = 0;
  std::vector<std::uint16_t> counts;  // by row [count]
};

// Reads a PNG file of 8 or 16 bits of grey, `columns` wide. Throws unfurl::Error for any other
// file.
GreyPicture ReadGreyPng(const std::string& path, std::size_t columns);

// The bytes of a PNG file. `pixels`: 8 bits each of blue, green and red, row by row.
std::string PngOf(const unsigned char* pixels, std::size_t rows, std::size_t columns);

}  // namespace unfurl::measure
