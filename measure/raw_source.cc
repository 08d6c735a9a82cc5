#include "measure/raw_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "data/h5.h"
#include "measure/png.h"

namespace unfurl::measure {

namespace {

// What the three kinds share: the list of files and where in it one is.
class FileList : public RawSource {
 public:
  FileList(const data::RawLayout& layout, std::size_t which, const std::vector<std::string>& files)
      : layout_(layout),
        files_(files),
        width_(layout.Width(which)),
        bits_(layout.header.format.Of(which).bits),
        full_(static_cast<unsigned>(layout.header.format.Of(which).full_scale())) {}

  double done() const override {
    return static_cast<double>(next_file_) / static_cast<double>(files_.size());
  }

 protected:
  const std::string& file() const { return files_[next_file_ - 1]; }

  // `line` counts from 1, `element` from 0.
  void Check(unsigned count, std::size_t line, std::size_t element) const {
    if (count <= full_) return;
    throw Error(fmt::format("the count {} of element {} is beyond {} bits", count, element, bits_),
                fmt::format("{}:{}", file(), line),
                "correct sensor.bits, or recording.shift and byte_order");
  }

  const data::RawLayout& layout_;
  const std::vector<std::string>& files_;
  std::size_t next_file_ = 0;
  std::size_t width_;  // counts in a line
  int bits_;
  unsigned full_;
};

class BinarySource : public FileList {
 public:
  using FileList::FileList;

  std::size_t Read(std::size_t count, std::uint16_t* out) override {
    const std::size_t width = width_, bytes = static_cast<std::size_t>(layout_.bytes);
    const std::size_t stride = layout_.line_header + width * bytes + layout_.line_trailer;
    buffer_.resize(stride);
    std::size_t lines = 0;
    while (lines < count) {
      if (!stream_.is_open() && !Open()) break;
      stream_.read(buffer_.data(), static_cast<std::streamsize>(stride));
      const std::size_t got = static_cast<std::size_t>(stream_.gcount());
      if (got == 0) {
        stream_.close();
        continue;
      }
      ++line_;
      if (got < stride) {
        throw Error(fmt::format("ends {} bytes into line {}, which has {}", got, line_, stride),
                    fmt::format("{}:{}", file(), line_),
                    "correct the sensor's elements, bytes, file_header, line_header or "
                    "line_trailer, or cut the file at a line's end");
      }
      const unsigned char* from =
          reinterpret_cast<const unsigned char*>(buffer_.data()) + layout_.line_header;
      std::uint16_t* to = out + lines * width;
      for (std::size_t k = 0; k < width; ++k, from += bytes) {
        const unsigned low = layout_.big_endian && bytes == 2 ? from[1] : from[0];
        const unsigned high = bytes == 1 ? 0U : layout_.big_endian ? from[0] : from[1];
        const unsigned value = (low | high << 8U) >> static_cast<unsigned>(layout_.shift);
        Check(value, line_, k);
        to[k] = static_cast<std::uint16_t>(value);
      }
      ++lines;
    }
    return lines;
  }

 private:
  bool Open() {
    if (next_file_ == files_.size()) return false;
    stream_.open(files_[next_file_++], std::ios::binary);
    stream_.seekg(0, std::ios::end);
    if (!stream_ || static_cast<std::size_t>(stream_.tellg()) < layout_.file_header) {
      throw Error("cannot be read, or is shorter than its header", file(),
                  "check the file and recording.file_header");
    }
    stream_.seekg(static_cast<std::streamoff>(layout_.file_header));
    line_ = 0;
    return true;
  }

  std::ifstream stream_;
  std::vector<char> buffer_;
  std::size_t line_ = 0;
};

class CsvSource : public FileList {
 public:
  using FileList::FileList;

  std::size_t Read(std::size_t count, std::uint16_t* out) override {
    const std::size_t width = width_;
    std::size_t lines = 0;
    while (lines < count) {
      if (!stream_.is_open() && !Open()) break;
      if (!std::getline(stream_, text_)) {
        stream_.close();
        continue;
      }
      ++line_;
      const std::string_view row = Trim(text_);
      if (row.empty() || row.front() == '#') continue;
      // The first row may name its columns.
      if (first_ && row.find_first_of("0123456789") != 0) {
        first_ = false;
        continue;
      }
      first_ = false;
      Parse(row, out + lines * width);
      ++lines;
    }
    return lines;
  }

 private:
  bool Open() {
    if (next_file_ == files_.size()) return false;
    stream_.open(files_[next_file_++]);
    if (!stream_) throw Error("cannot be read", file(), "check the file");
    line_ = 0;
    first_ = true;
    return true;
  }

  void Parse(std::string_view row, std::uint16_t* out) const {
    const std::size_t width = width_;
    const char* at = row.data();
    const char* end = at + row.size();
    std::size_t k = 0;
    for (; at < end; ++k) {
      unsigned value = 0;
      const auto [stop, error] = std::from_chars(at, end, value);
      if (error != std::errc()) {
        throw Error(fmt::format("cell {} is not a whole number", k + 1),
                    fmt::format("{}:{}", file(), line_), "give counts, separated by commas");
      }
      if (k < width) {
        Check(value, line_, k);
        out[k] = static_cast<std::uint16_t>(value);
      }
      at = stop;
      while (at < end && (*at == ' ' || *at == '\t')) ++at;
      if (at < end && (*at == ',' || *at == ';')) ++at;
      while (at < end && (*at == ' ' || *at == '\t')) ++at;
    }
    if (k != width) {
      throw Error(fmt::format("holds {} counts, but a line has {}", k, width),
                  fmt::format("{}:{}", file(), line_), "correct the sensor's elements, or the row");
    }
  }

  std::ifstream stream_;
  std::string text_;
  std::size_t line_ = 0;
  bool first_ = true;
};

// Rows of pictures are lines.
class PngSource : public FileList {
 public:
  using FileList::FileList;

  std::size_t Read(std::size_t count, std::uint16_t* out) override {
    std::size_t lines = 0;
    while (lines < count) {
      if (row_ == picture_.rows && !Open()) break;
      const std::uint16_t* from = &picture_.counts[row_ * width_];
      for (std::size_t k = 0; k < width_; ++k) {
        const unsigned shifted = static_cast<unsigned>(from[k]) >> layout_.shift;
        Check(shifted, row_ + 1, k);
        out[lines * width_ + k] = static_cast<std::uint16_t>(shifted);
      }
      ++row_;
      ++lines;
    }
    return lines;
  }

 private:
  bool Open() {
    if (next_file_ == files_.size()) return false;
    picture_ = ReadGreyPng(files_[next_file_++], width_);
    row_ = 0;
    return true;
  }

  GreyPicture picture_;
  std::size_t row_ = 0;
};

// Rows of a dataset are lines; of cameras side by side, cameras and elements may be two dimensions.
class Hdf5Source : public FileList {
 public:
  Hdf5Source(const data::RawLayout& layout, std::size_t which,
             const std::vector<std::string>& files)
      : FileList(layout, which, files), dataset_(layout.files[which].dataset) {}

  std::size_t Read(std::size_t count, std::uint16_t* out) override {
    std::size_t lines = 0;
    while (lines < count) {
      if (next_ == rows_ && !Open()) break;
      const std::size_t here = std::min(count - lines, rows_ - next_);
      // Wider than counts may be: what does not fit is refused, not cut.
      buffer_.resize(here * width_);
      reader_->ReadRows(dataset_, next_, here, std::span<std::int32_t>(buffer_));
      for (std::size_t k = 0; k < buffer_.size(); ++k) {
        if (buffer_[k] < 0) {
          throw Error(fmt::format("the count {} of element {} is negative", buffer_[k], k % width_),
                      Where(k), "give counts as they were read out");
        }
        const auto value =
            static_cast<unsigned>(buffer_[k]) >> static_cast<unsigned>(layout_.shift);
        Check(value, next_ + k / width_ + 1, k % width_);
        out[lines * width_ + k] = static_cast<std::uint16_t>(value);
      }
      next_ += here;
      lines += here;
    }
    return lines;
  }

 private:
  std::string Where(std::size_t k) const {
    return fmt::format("{}:{}", file(), next_ + k / width_ + 1);
  }

  bool Open() {
    if (next_file_ == files_.size()) return false;
    reader_ = std::make_unique<data::H5Reader>(files_[next_file_++], "", 0);
    const std::vector<std::size_t> dims = reader_->Dims(dataset_);
    std::size_t width = dims.empty() ? 0 : 1;
    for (std::size_t d = 1; d < dims.size(); ++d) width *= dims[d];
    if (dims.size() < 2 || width != width_) {
      throw Error(
          fmt::format("{} is {}, but a line has {} counts", dataset_,
                      dims.empty() ? "one number" : fmt::format("{}", fmt::join(dims, " x ")),
                      width_),
          file(), "give lines x elements; correct `dataset` or the sensor's elements");
    }
    rows_ = dims[0];
    next_ = 0;
    return true;
  }

  std::string dataset_;
  std::unique_ptr<data::H5Reader> reader_;
  std::vector<std::int32_t> buffer_;
  std::size_t next_ = 0, rows_ = 0;  // lines of the file
};

}  // namespace

std::unique_ptr<RawSource> OpenRawSource(const data::RawLayout& layout, std::size_t which,
                                         const std::vector<std::string>& files) {
  switch (layout.format) {
    case data::RawLayout::Format::kBinary:
      return std::make_unique<BinarySource>(layout, which, files);
    case data::RawLayout::Format::kCsv:
      return std::make_unique<CsvSource>(layout, which, files);
    case data::RawLayout::Format::kPng:
      return std::make_unique<PngSource>(layout, which, files);
    case data::RawLayout::Format::kHdf5:
      return std::make_unique<Hdf5Source>(layout, which, files);
  }
  return nullptr;
}

}  // namespace unfurl::measure
