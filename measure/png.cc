#include "measure/png.h"

#include <fmt/format.h>
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "base/error.h"

namespace unfurl::measure {
namespace {

// Deflate makes at most so many bytes of one [RFC 1951]: a header that claims more than the file
// can hold asks for memory in vain.
constexpr std::size_t kMostInflation = 1032;

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// libpng's own structures, freed whatever happens. It tells of errors by longjmp: each of the calls
// below that may jump lands in a function without objects that need destroying.
struct Reader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  Reader()
      : png(png_create_read_struct(
            PNG_LIBPNG_VER_STRING, nullptr,
            [](png_structp p, png_const_charp) { png_longjmp(p, 1); },
            [](png_structp, png_const_charp) {})) {
    if (png != nullptr) info = png_create_info_struct(png);
  }
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
};

bool ReadHeader(const Reader& r, std::FILE* file) {
  if (setjmp(png_jmpbuf(r.png)) != 0) return false;
  png_init_io(r.png, file);
  png_read_info(r.png, r.info);
  return true;
}

// Two bytes a count in the machine's order, or one.
bool ReadRows(const Reader& r, png_bytepp rows, bool swap) {
  if (setjmp(png_jmpbuf(r.png)) != 0) return false;
  if (swap) png_set_swap(r.png);
  png_set_interlace_handling(r.png);
  png_read_update_info(r.png, r.info);
  png_read_image(r.png, rows);
  png_read_end(r.png, nullptr);
  return true;
}

// What a picture that is not grey alone holds.
const char* ColoursOf(const Reader& r) {
  switch (png_get_color_type(r.png, r.info)) {
    case PNG_COLOR_TYPE_PALETTE:
      return "takes its colours from a palette";
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      return "is grey and transparent";
    default:
      return "is in colour";
  }
}

[[noreturn]] void ThrowUnreadable(const std::string& path) {
  throw Error("is no picture that can be read", path, "give a PNG file");
}

}  // namespace

GreyPicture ReadGreyPng(const std::string& path, std::size_t columns) {
  const std::unique_ptr<std::FILE, Closer> file(std::fopen(path.c_str(), "rb"));
  const Reader r;
  if (!file || r.info == nullptr || !ReadHeader(r, file.get())) ThrowUnreadable(path);
  const int bits = png_get_bit_depth(r.png, r.info);
  const bool grey = png_get_color_type(r.png, r.info) == PNG_COLOR_TYPE_GRAY;
  if (!grey || (bits != 8 && bits != 16)) {
    throw Error(grey ? fmt::format("is grey of {} bits, not of 8 or 16", bits)
                     : fmt::format("{}, not grey of 8 or 16 bits", ColoursOf(r)),
                path, "save it as grey of 8 or 16 bits");
  }
  GreyPicture picture;
  picture.rows = png_get_image_height(r.png, r.info);
  picture.columns = png_get_image_width(r.png, r.info);
  if (picture.columns != columns) {
    throw Error(fmt::format("is {} pixels wide, but a line has {}", picture.columns, columns), path,
                "correct the sensor's elements");
  }
  const std::size_t bytes = bits == 16 ? 2 : 1;
  std::error_code failed;
  const std::uintmax_t length = std::filesystem::file_size(path, failed);
  // Of a pipe the length is not known; its rows are then bounded by libpng alone.
  if (!failed && picture.rows * columns * bytes > kMostInflation * length) ThrowUnreadable(path);
  picture.counts.resize(picture.rows * columns);
  // Single bytes are read into the back half of each row, and spread from there.
  std::vector<png_bytep> rows(picture.rows);
  for (std::size_t k = 0; k < picture.rows; ++k) {
    rows[k] = reinterpret_cast<png_bytep>(&picture.counts[k * columns]) + (2 - bytes) * columns;
  }
  if (!ReadRows(r, rows.data(), bytes == 2 && std::endian::native == std::endian::little)) {
    ThrowUnreadable(path);
  }
  for (std::size_t k = 0; bytes == 1 && k < picture.rows; ++k) {
    for (std::size_t c = 0; c < columns; ++c) picture.counts[k * columns + c] = rows[k][c];
  }
  return picture;
}

std::string PngOf(const unsigned char* pixels, std::size_t rows, std::size_t columns) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(columns);
  image.height = static_cast<png_uint_32>(rows);
  image.format = PNG_FORMAT_BGR;
  png_alloc_size_t size = 0;
  std::string bytes;
  if (png_image_write_get_memory_size(image, size, 0, pixels, 0, nullptr) != 0) {
    bytes.resize(size);
    if (png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, nullptr) != 0) {
      return bytes;
    }
  }
  throw Error(fmt::format("a picture of {} by {} could not be packed: {}", columns, rows,
                          std::string(image.message)),
              "PNG", "free memory");
}

}  // namespace unfurl::measure
