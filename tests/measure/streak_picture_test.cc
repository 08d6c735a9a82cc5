#include "measure/streak_picture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "base/random.h"

namespace unfurl::measure {
namespace {

data::TrialHeader OneCamera() {
  data::TrialHeader header;
  header.cameras = {"only"};
  header.slots = {"mark1", "dark"};
  header.format.electrons_per_count = 15.0;
  return header;
}

// The picture of a trial whose one mark stays at `pixel` (or nowhere: -1).
cv::Mat PictureOf(int pixel) {
  const data::TrialHeader header = OneCamera();
  constexpr std::size_t kLines = 200;
  data::TrialBlock block;
  block.Resize(kLines, header);
  Rng rng(1);
  for (std::size_t i = 0; i < kLines; ++i) {
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
  StreakPicture picture(header, kLines);
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

TEST(StreakPicture, NoiseAloneIsDark) { EXPECT_EQ(BrightestRow(PictureOf(-1)), -1); }

}  // namespace
}  // namespace unfurl::measure
