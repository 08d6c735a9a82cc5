#include "measure/png.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "tests/own_folder.h"

// OpenCV's own reader and writer, which the program does not have, are the reference.
namespace unfurl::measure::png_test {
namespace {

using ::testing::HasSubstr;

constexpr int kRows = 7, kColumns = 33;

class PngTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.File(name); }
  static std::string Complaint(const std::string& path, std::size_t columns = kColumns) {
    try {
      ReadGreyPng(path, columns);
    } catch (const Error& e) {
      return e.what();
    }
    return "nothing was refused";
  }
  // Every value that goes with the depth, from end to end.
  template <typename Count>
  static cv::Mat Ramp(int type, double full_scale) {
    cv::Mat picture(kRows, kColumns, type);
    for (int k = 0; k < kRows * kColumns; ++k) {
      picture.at<Count>(k / kColumns, k % kColumns) =
          static_cast<Count>(full_scale * k / (kRows * kColumns - 1));
    }
    return picture;
  }
  const OwnFolder folder_;
};

TEST_F(PngTest, CountsAreThoseOfTheFile) {
  const cv::Mat eight = Ramp<std::uint8_t>(CV_8U, 255.0),
                sixteen = Ramp<std::uint16_t>(CV_16U, 65535.0);
  ASSERT_TRUE(cv::imwrite(Path("8.png"), eight) && cv::imwrite(Path("16.png"), sixteen));
  const GreyPicture a = ReadGreyPng(Path("8.png"), kColumns),
                    b = ReadGreyPng(Path("16.png"), kColumns);
  ASSERT_EQ(a.rows, kRows);
  ASSERT_EQ(b.counts.size(), kRows * kColumns);
  for (int k = 0; k < kRows * kColumns; ++k) {
    EXPECT_EQ(a.counts[k], eight.at<std::uint8_t>(k / kColumns, k % kColumns));
    EXPECT_EQ(b.counts[k], sixteen.at<std::uint16_t>(k / kColumns, k % kColumns));
  }
}

// Colours, too few bits, another width, no picture, half a picture, a header that promises more
// rows than its file can hold.
TEST_F(PngTest, OthersAreRefusedByName) {
  ASSERT_TRUE(cv::imwrite(Path("colour.png"), cv::Mat(4, kColumns, CV_8UC3, cv::Scalar(1, 2, 3))));
  EXPECT_THAT(Complaint(Path("colour.png")), HasSubstr("is in colour"));
  // One index a pixel, into colours: no grey, though as many bytes.
  png_image palette = {};
  palette.version = PNG_IMAGE_VERSION;
  palette.width = kColumns;
  palette.height = 1;
  palette.format = PNG_FORMAT_RGB_COLORMAP;
  palette.colormap_entries = 2;
  const std::vector<unsigned char> index(kColumns, 1), colours = {0, 0, 0, 9, 8, 7};
  ASSERT_NE(png_image_write_to_file(&palette, Path("palette.png").c_str(), 0, index.data(), 0,
                                    colours.data()),
            0);
  EXPECT_THAT(Complaint(Path("palette.png")), HasSubstr("takes its colours from a palette"));
  ASSERT_TRUE(
      cv::imwrite(Path("bits.png"), Ramp<std::uint8_t>(CV_8U, 1.0), {cv::IMWRITE_PNG_BILEVEL, 1}));
  EXPECT_THAT(Complaint(Path("bits.png")), HasSubstr("grey of 1 bits"));
  ASSERT_TRUE(cv::imwrite(Path("whole.png"), Ramp<std::uint16_t>(CV_16U, 65535.0)));
  EXPECT_THAT(Complaint(Path("whole.png"), kColumns + 1), HasSubstr("is 33 pixels wide"));
  EXPECT_THAT(Complaint(Path("none.png")), HasSubstr("no picture"));
  std::ofstream(Path("text.png")) << "x,y\n1,2\n";
  EXPECT_THAT(Complaint(Path("text.png")), HasSubstr("no picture"));
  std::filesystem::copy_file(Path("whole.png"), Path("half.png"));
  std::filesystem::resize_file(Path("half.png"), std::filesystem::file_size(Path("half.png")) / 2);
  EXPECT_THAT(Complaint(Path("half.png")), HasSubstr("no picture"));

  // A million rows, with the check sum (of 13 bytes after the length, that of "IHDR") that goes
  // with them: by zlib's own table, which is not at hand here, bit by bit.
  std::string bytes;
  {
    std::ifstream in(Path("whole.png"), std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  bytes[20] = 0, bytes[21] = 0x0F, bytes[22] = 0x42, bytes[23] = 0x40;
  std::uint32_t crc = 0xFFFFFFFFU;
  for (int k = 12; k < 29; ++k) {
    crc ^= static_cast<unsigned char>(bytes[k]);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ (crc & 1U ? 0xEDB88320U : 0U);
  }
  crc = ~crc;
  for (int k = 0; k < 4; ++k) bytes[29 + k] = static_cast<char>(crc >> (24 - 8 * k) & 0xFFU);
  std::ofstream(Path("many.png"), std::ios::binary) << bytes;
  EXPECT_THAT(Complaint(Path("many.png")), HasSubstr("no picture"));
}

TEST_F(PngTest, WrittenPicturesAreReadByOthers) {
  cv::Mat page(5, 9, CV_8UC3);
  for (int k = 0; k < 45; ++k) {
    page.at<cv::Vec3b>(k / 9, k % 9) = {static_cast<unsigned char>(k),
                                        static_cast<unsigned char>(255 - k),
                                        static_cast<unsigned char>(5 * k)};
  }
  const std::string bytes = PngOf(page.data, 5, 9);
  const cv::Mat read =
      cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.size(), page.size());
  EXPECT_EQ(cv::norm(read, page, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace unfurl::measure::png_test
