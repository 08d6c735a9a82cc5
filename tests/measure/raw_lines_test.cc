#include "measure/raw_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "data/h5.h"

namespace unfurl::measure::raw_lines_test {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kElements = 4 + 10 + 70 + 5 + 2;
constexpr std::size_t kLines = 37;
constexpr char kSensor[] =
    "[sensor]\nbits = 12\ndummy = 4\ndark = 10\nactive = 70\ndark_after = 5\nparity = 2\n"
    "electrons_per_count = 15.0\nread_noise_counts = 2.0\n";
constexpr char kSchedule[] =
    "line_rate = 500.0\nslots = [\"a\", \"b\", \"a+b\", \"dark\"]\nfirst_slot = 2\n";

// A folder with what two cameras have recorded.
class RawLinesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) / ("raw" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
    Rng rng(2);
    for (auto& counts : counts_) {
      counts.resize(kLines * kElements);
      for (auto& count : counts) count = static_cast<std::uint16_t>(rng.Integer(4096));
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }
  std::string Layout(const std::string& recording, const std::string& rest) const {
    return Put("lines.toml", std::string(kSensor) + "[recording]\n" + kSchedule + recording + rest);
  }
  // Lines [first, last) of a camera as bytes.
  std::string Bytes(int camera, std::size_t first, std::size_t last, bool big, int shift,
                    const std::string& before = "", const std::string& after = "") const {
    std::string bytes;
    for (std::size_t i = first; i < last; ++i) {
      bytes += before;
      for (std::size_t k = 0; k < kElements; ++k) {
        const unsigned value = static_cast<unsigned>(counts_[camera][i * kElements + k]) << shift;
        const char low = static_cast<char>(value & 255U), high = static_cast<char>(value >> 8U);
        bytes += big ? high : low;
        bytes += big ? low : high;
      }
      bytes += after;
    }
    return bytes;
  }
  std::string Rows(int camera, std::size_t first, std::size_t last, char separator) const {
    std::ostringstream text;
    for (std::size_t i = first; i < last; ++i) {
      for (std::size_t k = 0; k < kElements; ++k) {
        text << (k > 0 ? std::string(1, separator) : "") << counts_[camera][i * kElements + k];
      }
      text << "\n";
    }
    return text.str();
  }

  // Everything the layout leads to, read in blocks of this size, must be what was recorded.
  void ExpectAll(const std::string& layout, std::size_t block_size) const {
    RawLines lines(data::ReadRawLayout(layout));
    EXPECT_EQ(lines.header().cameras, (std::vector<std::string>{"door", "window"}));
    EXPECT_EQ(lines.header().slots, (std::vector<std::string>{"a", "b", "a+b", "dark"}));
    data::TrialBlock block;
    std::size_t at = 0;
    while (lines.Read(block_size, &block)) {
      for (std::size_t i = 0; i < block.size(); ++i, ++at) {
        EXPECT_NEAR(block.t[i], (static_cast<double>(at) + 0.5) / 500.0, 1e-12);
        EXPECT_EQ(block.slot[i], static_cast<std::int32_t>((at + 2) % 4));
        for (std::size_t c = 0; c < 2; ++c) {
          for (std::size_t k = 0; k < kElements; ++k) {
            ASSERT_EQ(block.counts[(i * 2 + c) * kElements + k], counts_[c][at * kElements + k]);
          }
        }
      }
    }
    EXPECT_EQ(at, kLines);
  }
  std::string ErrorOf(const std::string& layout) const {
    try {
      RawLines lines(data::ReadRawLayout(layout));
      data::TrialBlock block;
      while (lines.Read(8, &block)) {
      }
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
  std::vector<std::uint16_t> counts_[2];
};

constexpr char kByCamera[] =
    "[camera.door]\nfiles = [\"door_*.raw\"]\n[camera.window]\nfiles = [\"window.raw\"]\n";

TEST_F(RawLinesTest, BinaryInEveryOrderOfBytes) {
  for (const bool big : {false, true}) {
    for (const int shift : {0, 4}) {
      Put("door_1.raw", "HEAD" + Bytes(0, 0, 20, big, shift, "xx", "y"));
      Put("door_2.raw", "HEAD" + Bytes(0, 20, kLines, big, shift, "xx", "y"));
      Put("window.raw", "HEAD" + Bytes(1, 0, kLines, big, shift, "xx", "y"));
      const std::string layout = Layout(
          "format = \"binary\"\nfile_header = 4\nline_header = 2\nline_trailer = 1\nshift = " +
              std::to_string(shift) + "\nbyte_order = \"" + (big ? "big" : "little") + "\"\n",
          kByCamera);
      for (const std::size_t block : {1U, 7U, 100U}) ExpectAll(layout, block);
    }
  }
}

TEST_F(RawLinesTest, CamerasSideBySideInOneFile) {
  std::string bytes;
  for (std::size_t i = 0; i < kLines; ++i) {
    bytes += Bytes(0, i, i + 1, false, 0) + Bytes(1, i, i + 1, false, 0);
  }
  Put("all.raw", bytes);
  ExpectAll(
      Layout("format = \"binary\"\ncameras = [\"door\", \"window\"]\nfiles = [\"all.raw\"]\n", ""),
      10);
}

TEST_F(RawLinesTest, Csv) {
  Put("door_1.raw", "# from the grabber\npixel0,pixel1\n" + Rows(0, 0, kLines, ','));
  Put("window.raw", Rows(1, 0, 5, ';') + "\n" + Rows(1, 5, kLines, ' '));
  ExpectAll(Layout("format = \"csv\"\n", kByCamera), 11);
}

// Lines of any HDF5 file: datasets by camera, or all cameras in one of two dimensions or three.
TEST_F(RawLinesTest, Hdf5Datasets) {
  const auto rows = [&](int camera, std::size_t first, std::size_t last) {
    return std::vector<std::uint16_t>(
        counts_[camera].begin() + static_cast<std::ptrdiff_t>(first * kElements),
        counts_[camera].begin() + static_cast<std::ptrdiff_t>(last * kElements));
  };
  const auto write = [&](const std::string& name, const std::string& dataset,
                         const std::vector<std::uint16_t>& values, std::vector<std::size_t> dims) {
    data::H5Writer file((folder_ / name).string(), "someone/else", 1, {});
    file.Write({dataset, "1", "lines"}, values, std::move(dims));
    file.Commit();
  };
  write("door_1.raw", "/entry/detector/data", rows(0, 0, 20), {20, kElements});
  write("door_2.raw", "/entry/detector/data", rows(0, 20, kLines), {kLines - 20, kElements});
  write("window.raw", "/lines", rows(1, 0, kLines), {kLines, kElements});
  ExpectAll(Layout("format = \"hdf5\"\ndataset = \"/entry/detector/data\"\n",
                   std::string(kByCamera) + "dataset = \"/lines\"\n"),
            11);
  std::vector<std::uint16_t> both;
  for (std::size_t i = 0; i < kLines; ++i) {
    for (int c = 0; c < 2; ++c) {
      const auto row = rows(c, i, i + 1);
      both.insert(both.end(), row.begin(), row.end());
    }
  }
  const std::string together =
      "format = \"hdf5\"\ncameras = [\"door\", \"window\"]\nfiles = [\"all.h5\"]\n";
  for (const auto& dims : {std::vector<std::size_t>{kLines, 2 * kElements},
                           std::vector<std::size_t>{kLines, 2, kElements}}) {
    write("all.h5", "/lines", both, dims);
    ExpectAll(Layout(together + "dataset = \"/lines\"\n", ""), 10);
  }
  EXPECT_THAT(ErrorOf(Layout(together, "")), HasSubstr("does not say which dataset"));
  EXPECT_THAT(ErrorOf(Layout(together + "dataset = \"/counts\"\n", "")),
              HasSubstr("all.h5:/counts: has no such dataset"));
  write("all.h5", "/lines", rows(0, 0, kLines), {kLines, kElements});
  EXPECT_THAT(ErrorOf(Layout(together + "dataset = \"/lines\"\n", "")),
              HasSubstr("/lines is 37 x 91, but a line has 182 counts"));
  data::H5Writer file((folder_ / "all.h5").string(), "someone/else", 1, {});
  std::vector<double> low(both.begin(), both.end());
  low[3] = -5.0;
  file.Write({"/lines", "1", "lines"}, low, {kLines, 2 * kElements});
  file.Commit();
  EXPECT_THAT(ErrorOf(Layout(together + "dataset = \"/lines\"\n", "")),
              HasSubstr("all.h5:1: the count -5 of element 3 is negative"));
}

TEST_F(RawLinesTest, Png) {
  for (int c = 0; c < 2; ++c) {
    cv::Mat picture(static_cast<int>(kLines), static_cast<int>(kElements), CV_16U,
                    counts_[c].data());
    const auto write = [&](const std::string& name, int from, int to) {
      ASSERT_TRUE(cv::imwrite((folder_ / name).string(), picture.rowRange(from, to)));
    };
    if (c == 0) {
      write("door_1.png", 0, 30);
      write("door_2.png", 30, static_cast<int>(kLines));
    } else {
      write("window.png", 0, static_cast<int>(kLines));
    }
  }
  const std::string layout = Layout(
      "format = \"png\"\n",
      "[camera.door]\nfiles = [\"door_*.png\"]\n[camera.window]\nfiles = [\"window.png\"]\n");
  for (const std::size_t block : {4U, 64U}) ExpectAll(layout, block);
}

TEST_F(RawLinesTest, StampsOfTheirOwn) {
  Put("door_1.raw", Bytes(0, 0, 4, false, 0));
  Put("window.raw", Bytes(1, 0, 4, false, 0));
  const std::string layout = Layout("format = \"binary\"\nstamps = \"t.csv\"\n", kByCamera);
  // The third line was dropped by the grabber: the cycle alone would be wrong from there on.
  Put("t.csv", "t [s],slot\n0.001,a\n0.003,b\n0.007,dark\n0.009,a\n");
  RawLines lines(data::ReadRawLayout(layout));
  data::TrialBlock block;
  ASSERT_TRUE(lines.Read(10, &block));
  EXPECT_EQ(block.t, (std::vector<double>{0.001, 0.003, 0.007, 0.009}));
  EXPECT_EQ(block.slot, (std::vector<std::int32_t>{0, 1, 3, 0}));
  EXPECT_FALSE(lines.Read(10, &block));
  Put("t.csv", "t [s]\n0.001\n0.003\n0.002\n0.009\n");
  EXPECT_THAT(ErrorOf(layout), HasSubstr("t.csv:4"));
  Put("t.csv", "t [s]\n0.001\n0.003\n");
  EXPECT_THAT(ErrorOf(layout), HasSubstr("fewer stamps"));
  Put("t.csv", "t [s]\n1\n2\n3\n4\n5\n");
  EXPECT_THAT(ErrorOf(layout), HasSubstr("more stamps"));
  Put("t.csv", "t [s],slot\n1,a\n2,c\n3,a\n4,a\n");
  EXPECT_THAT(ErrorOf(layout), HasSubstr("'c' is not known"));
  Put("t.csv", "time\n1\n");
  EXPECT_THAT(ErrorOf(layout), HasSubstr("t.csv:1"));
}

TEST_F(RawLinesTest, FlatField) {
  // Even light of 1000 counts on pixels that answer 1, 1.25, 1, 1.25, ..; offset 60.
  std::string lit, dark;
  for (std::size_t k = 0; k < kElements; ++k) {
    const unsigned value = 60 + (k % 2 == 1 ? 1250 : 1000);
    lit += static_cast<char>(value & 255U);
    lit += static_cast<char>(value >> 8U);
    dark += std::string("\x3c\0", 2);
  }
  Put("door_1.raw", Bytes(0, 0, kLines, false, 0));
  Put("window.raw", Bytes(1, 0, kLines, false, 0));
  Put("lit.raw", lit + lit);
  Put("dark.raw", dark);
  const std::string flat = "flat = [\"lit.raw\"]\nflat_dark = [\"dark.raw\"]\n";
  const std::string layout =
      Layout("format = \"binary\"\n", "[camera.door]\nfiles = [\"door_1.raw\"]\n" + flat +
                                          "[camera.window]\nfiles = [\"window.raw\"]\n" + flat);
  const RawLines lines(data::ReadRawLayout(layout));
  ASSERT_EQ(lines.header().response.size(), 140U);
  for (std::size_t k = 0; k < 140; ++k) {
    EXPECT_NEAR(lines.header().response[k], (k % 2 == 1 ? 1250.0 : 1000.0) / 1125.0, 1e-6);
  }
  Put("lit.raw", dark);
  EXPECT_THAT(ErrorOf(layout), HasSubstr("flat field"));
}

TEST_F(RawLinesTest, RefusesByFileLineAndKey) {
  Put("door_1.raw", Bytes(0, 0, kLines, false, 0));
  Put("window.raw", Bytes(1, 0, kLines, false, 0));
  const std::string binary = "format = \"binary\"\n";
  EXPECT_EQ(ErrorOf(Layout(binary, kByCamera)), "no error");
  EXPECT_THAT(ErrorOf(Layout("format = \"tiff\"\n", kByCamera)), HasSubstr("recording.format"));
  EXPECT_THAT(ErrorOf(Layout(binary + "byteorder = \"big\"\n", kByCamera)),
              HasSubstr("byte_order"));
  EXPECT_THAT(ErrorOf(Layout(binary + "bytes = 1\n", kByCamera)), HasSubstr("do not fit"));
  EXPECT_THAT(ErrorOf(Layout(binary + "byte_order = \"big\"\n", kByCamera)),
              HasSubstr("beyond 12 bits"));
  EXPECT_THAT(ErrorOf(Layout(binary + "file_header = 3\n", kByCamera)),
              HasSubstr("door_1.raw:"));  // read askew: counts beyond the bits, or a cut line
  EXPECT_THAT(ErrorOf(Layout(binary, "[camera.door]\nfiles = [\"nowhere.raw\"]\n")),
              AllOf(HasSubstr("camera.door.files"), HasSubstr("no file")));
  EXPECT_THAT(ErrorOf(Layout(binary, "[camera.door]\nfiles = [\"x*.raw\"]\n")),
              HasSubstr("no file is named like"));
  EXPECT_THAT(ErrorOf(Layout(binary, "")), HasSubstr("no camera"));
  EXPECT_THAT(ErrorOf(Layout(binary, std::string(kByCamera) + "flat = [\"window.raw\"]\n")),
              HasSubstr("flat_dark"));
  Put("window.raw", Bytes(1, 0, kLines - 3, false, 0));
  EXPECT_THAT(ErrorOf(Layout(binary, kByCamera)),
              AllOf(HasSubstr("ends after 34 lines"), HasSubstr("camera.window")));
  Put("window.raw", Bytes(1, 0, kLines, false, 0).substr(0, 3000));
  EXPECT_THAT(ErrorOf(Layout(binary, kByCamera)),
              AllOf(HasSubstr("window.raw:17"), HasSubstr("bytes into line 17")));
  Put("window.raw", "");
  Put("door_1.raw", "");
  EXPECT_THAT(ErrorOf(Layout(binary, kByCamera)), HasSubstr("holds no line"));
  Put("door_1.raw", Rows(0, 0, 3, ','));
  Put("window.raw", Rows(1, 0, 2, ',') + "1,2,3\n");
  EXPECT_THAT(ErrorOf(Layout("format = \"csv\"\n", kByCamera)),
              AllOf(HasSubstr("window.raw:3"), HasSubstr("holds 3 counts")));
  Put("window.raw", Rows(1, 0, 2, ',') + "1,two,3\n");
  EXPECT_THAT(ErrorOf(Layout("format = \"csv\"\n", kByCamera)), HasSubstr("cell 2"));
  EXPECT_THAT(ErrorOf(Layout("format = \"png\"\n", kByCamera)), HasSubstr("is no picture"));
}

}  // namespace
}  // namespace unfurl::measure::raw_lines_test
