#include "measure/streak_picture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "base/random.h"

namespace unfurl::measure::streak_picture_test {
namespace {

data::TrialHeader OneCamera() {
  data::TrialHeader header;
  header.cameras = {"only"};
  header.slots = {"mark1", "dark"};
  header.format.electrons_per_count = 15.0;
  return header;
}

// The picture of a trial of so many lines, 1 ms apart, whose one mark stays at `pixel` (or nowhere:
// -1).
cv::Mat PictureOf(int pixel, std::size_t lines = 200) {
  const data::TrialHeader header = OneCamera();
  data::TrialBlock block;
  block.Resize(lines, header);
  Rng rng(1);
  for (std::size_t i = 0; i < lines; ++i) {
    block.t[i] = 1e-3 * static_cast<double>(i);
    block.slot[i] = static_cast<std::int32_t>((i + 1) % 2);
    std::uint16_t* line = &block.counts[i * header.format.elements()];
    for (std::size_t k = 0; k < header.format.elements(); ++k) {
      line[k] = static_cast<std::uint16_t>(60.0 + 2.0 * rng.Normal());
    }
    if (block.slot[i] == 0 && pixel >= 0) {
      line[header.format.first_active() + static_cast<std::size_t>(pixel)] = 2000;
    }
  }
  StreakPicture picture(header, lines);
  picture.Add(block);
  const std::string path = testing::TempDir() + std::to_string(getpid()) + "streak.png";
  picture.Write(path);
  const cv::Mat image = cv::imread(path);
  std::remove(path.c_str());
  return image;
}

// Mean over the middle third of the columns, where no label is; the brightest row of it.
int BrightestRow(const cv::Mat& image) {
  int best = -1;
  double most = -1.0;
  for (int row = 0; row < image.rows - 40; ++row) {
    const cv::Mat part = image.row(row).colRange(image.cols * 2 / 3 - 30, image.cols * 2 / 3);
    const cv::Scalar mean = cv::mean(part);
    const double colour =
        std::max({mean[0], mean[1], mean[2]}) - std::min({mean[0], mean[1], mean[2]});
    if (colour > most) {
      most = colour;
      best = row;
    }
  }
  return most > 40.0 ? best : -1;
}

TEST(StreakPicture, AMarkIsAColouredLineWherePixelsSayItIs) {
  const int low = BrightestRow(PictureOf(300));
  const int high = BrightestRow(PictureOf(1800));
  ASSERT_GT(low, 0);
  ASSERT_GT(high, 0);
  // Upward, nine pixels to a row of the picture.
  EXPECT_NEAR(low - high, 1500.0 / 9.0, 1.0);
}

// The name below is written in the colour of its line.
TEST(StreakPicture, ANameHasTheColourOfItsLine) {
  const cv::Mat image = PictureOf(1000, 1400);
  const auto most_coloured = [&](int first, int last) {
    cv::Vec3b best;
    double most = -1.0;
    for (int row = first; row < last; ++row) {
      for (int column = 0; column < image.cols; ++column) {
        const cv::Vec3b pixel = image.at<cv::Vec3b>(row, column);
        const auto [low, high] = std::minmax({pixel[0], pixel[1], pixel[2]});
        if (high - low > most) most = high - low, best = pixel;
      }
    }
    return cv::Vec3d(best) / cv::norm(cv::Vec3d(best));
  };
  const int foot = image.rows - 25;  // where the names are
  // Bytes of a dim line round to a per cent, and the page is not quite black.
  EXPECT_LT(cv::norm(most_coloured(0, foot) - most_coloured(foot, image.rows)), 0.05);
}

// Ticks are steps of 1, 2 or 5 times a power of ten, 5 to 10 of them.
TEST(StreakPicture, TicksOfTimeAreRoundNumbers) {
  const auto spacing = [](std::size_t lines) {  // of the ticks [s], of a record of so many ms
    const cv::Mat image = PictureOf(-1, lines);
    for (int row = image.rows - 1; row >= 0; --row) {
      std::vector<int> at;
      for (int column = 0; column < image.cols; ++column) {
        if (image.at<cv::Vec3b>(row, column) == cv::Vec3b(190, 190, 190)) at.push_back(column);
      }
      bool even = at.size() >= 5;
      const double step =
          even ? static_cast<double>(at.back() - at.front()) / static_cast<double>(at.size() - 1)
               : 0.0;
      for (std::size_t i = 0; i < at.size(); ++i) {
        even = even && step > 10.0 && std::abs(at[i] - at[0] - step * static_cast<double>(i)) < 1.5;
      }
      // A column is a pair of lines; the first is at 0 s.
      if (even) return step * 2e-3;
    }
    return 0.0;
  };
  EXPECT_NEAR(spacing(1400), 0.2, 0.003);  // a column more or less in ten
  EXPECT_NEAR(spacing(950), 0.1, 0.003);
  EXPECT_NEAR(spacing(490), 0.05, 0.003);
}

TEST(StreakPicture, NoiseAloneIsDark) { EXPECT_EQ(BrightestRow(PictureOf(-1)), -1); }

}  // namespace
}  // namespace unfurl::measure::streak_picture_test
