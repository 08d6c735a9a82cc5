#include "measure/streak_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "data/atomic_file.h"
#include "data/lab.h"
#include "measure/png.h"

namespace unfurl::measure {

namespace {

constexpr int kWidth = 1400;              // of a panel, at most [picture px]
constexpr int kHeight = 240;              // of a panel [picture px]
constexpr int kStreakPictureMargin = 46;  // for the labels
constexpr int kPanelGap = 26;             // above each panel
constexpr double kGamma = 0.45;           // a screen's own, about 1 / 2.2: faint streaks show
constexpr double kFloorSigmas = 5.0;      // what counts as dark

// Distinct on black, blue-green-red.
const std::array<cv::Vec3f, 6> kColours = {
    cv::Vec3f(0.25F, 0.75F, 1.0F), cv::Vec3f(1.0F, 0.75F, 0.25F), cv::Vec3f(0.45F, 1.0F, 0.45F),
    cv::Vec3f(0.85F, 0.45F, 1.0F), cv::Vec3f(0.4F, 1.0F, 1.0F),   cv::Vec3f(1.0F, 1.0F, 1.0F)};

// A step of 1, 2 or 5 times a power of ten, near a tenth of `range`.
double TickStep(double range) {
  const double raw = range / 10.0;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  for (double m : {1.0, 2.0, 5.0}) {
    if (m * decade >= raw) return m * decade;
  }
  return 10.0 * decade;
}

}  // namespace

struct StreakPicture::Impl {
  data::TrialHeader header;
  std::size_t lines;
  int width;
  std::size_t next = 0;
  double first_t = 0.0, last_t = 0.0;
  std::vector<cv::Mat> panels;  // by camera: kHeight x width, light per colour
  std::vector<cv::Mat> dark;    // by camera: the last dark line's active pixels
  std::vector<double> noise;    // by camera [count]
};

StreakPicture::StreakPicture(const data::TrialHeader& header, std::size_t lines)
    : impl_(std::make_unique<Impl>()) {
  impl_->header = header;
  impl_->lines = std::max<std::size_t>(lines, 1);
  // A column holds a whole round of slots at least, so that each mark is in each.
  const std::size_t rounds = std::max<std::size_t>(1, impl_->lines / header.slots.size());
  impl_->width = static_cast<int>(std::min<std::size_t>(rounds, kWidth));
  impl_->dark.resize(header.cameras.size());
  impl_->noise.resize(header.cameras.size(), 0.0);
  for (std::size_t c = 0; c < header.cameras.size(); ++c) {
    impl_->panels.emplace_back(cv::Mat::zeros(kHeight, impl_->width, CV_32FC3));
  }
}

StreakPicture::~StreakPicture() = default;

void StreakPicture::Add(const data::TrialBlock& block) {
  Impl& im = *impl_;
  const std::size_t cameras = im.header.cameras.size();
  if (im.next == 0 && block.size() > 0) im.first_t = block.t.front();
  if (block.size() > 0) im.last_t = block.t.back();
  cv::Mat light, column, padded;
  for (std::size_t i = 0; i < block.size(); ++i, ++im.next) {
    const std::size_t slot = static_cast<std::size_t>(block.slot[i]);
    const bool is_dark = im.header.slots[slot] == data::kDarkSlot;
    const int x = static_cast<int>(im.next * static_cast<std::size_t>(im.width) / im.lines);
    for (std::size_t c = 0; c < cameras; ++c) {
      const data::LineFormat& format = im.header.format.Of(c);
      const std::uint16_t* counts = block.Line(im.header, i, c).data() + format.first_active();
      const cv::Mat line(1, format.active, CV_16U, const_cast<std::uint16_t*>(counts));
      line.convertTo(light, CV_32F);
      if (is_dark) {
        cv::Scalar mean, deviation;
        cv::meanStdDev(light, mean, deviation);
        im.noise[c] = deviation[0];
        light.copyTo(im.dark[c]);
        continue;
      }
      if (im.dark[c].empty()) continue;
      cv::subtract(light, im.dark[c], light);
      // The brightest pixel of each group stands for it: a mean would drown spots a few wide.
      const int group = (format.active + kHeight - 1) / kHeight;
      cv::copyMakeBorder(light, padded, 0, 0, 0, group * kHeight - format.active,
                         cv::BORDER_CONSTANT, 0);
      cv::reduce(padded.reshape(1, kHeight), column, 1, cv::REDUCE_MAX);
      const float floor = static_cast<float>(kFloorSigmas * im.noise[c]);
      const float scale = static_cast<float>(1.0 / format.full_scale());
      const cv::Vec3f& colour = kColours[slot % kColours.size()];
      for (int row = 0; row < kHeight; ++row) {
        const float value = column.at<float>(row, 0);
        if (value <= floor) continue;
        const float tone = std::pow(value * scale, static_cast<float>(kGamma));
        cv::Vec3f& pixel = im.panels[c].at<cv::Vec3f>(kHeight - 1 - row, x);
        for (int k = 0; k < 3; ++k) pixel[k] = std::max(pixel[k], tone * colour[k]);
      }
    }
  }
}

void StreakPicture::Write(const std::string& path) const {
  const Impl& im = *impl_;
  const int panels = static_cast<int>(im.panels.size());
  const int total_height = panels * (kHeight + kPanelGap) + 2 * kStreakPictureMargin;
  cv::Mat page(total_height, im.width + 2 * kStreakPictureMargin, CV_8UC3, cv::Scalar(24, 20, 18));
  const auto text = [&](const std::string& words, int x, int y, const cv::Scalar& colour) {
    cv::putText(page, words, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv::LINE_AA);
  };
  const cv::Scalar grey(190, 190, 190);
  const double range = std::max(1e-9, im.last_t - im.first_t);
  const double step = TickStep(range);
  for (int c = 0; c < panels; ++c) {
    const cv::Rect place(kStreakPictureMargin, kStreakPictureMargin + c * (kHeight + kPanelGap),
                         im.width, kHeight);
    cv::Mat soft, bytes;
    cv::GaussianBlur(im.panels[static_cast<std::size_t>(c)], soft, {3, 3}, 0.6);
    soft.convertTo(bytes, CV_8UC3, 255.0);
    bytes.copyTo(page(place));
    cv::rectangle(page, place + cv::Size(1, 1) - cv::Point(1, 1), {90, 90, 90});
    text(im.header.cameras[static_cast<std::size_t>(c)], place.x, place.y - 7, grey);
    const data::LineFormat& format = im.header.format.Of(static_cast<std::size_t>(c));
    text(std::to_string(format.active - 1), place.x - 40, place.y + 10, grey);
    text("0", place.x - 14, place.y + kHeight, grey);
    const double first_tick = std::ceil(im.first_t / step) * step;
    const int ticks = static_cast<int>(std::floor((im.last_t - first_tick) / step));
    for (int k = 0; k <= ticks; ++k) {
      const double t = first_tick + k * step;
      const int x = place.x + static_cast<int>((t - im.first_t) / range * (im.width - 1));
      cv::line(page, {x, place.y + kHeight}, {x, place.y + kHeight + 4}, grey);
      if (c == panels - 1) text(fmt::format("{:g}", t), x - 8, place.y + kHeight + 18, grey);
    }
  }
  text("time on the recorder's clock [s]; pixel upward", kStreakPictureMargin, total_height - 10,
       grey);
  int x = kStreakPictureMargin + 380;
  for (std::size_t s = 0; s < im.header.slots.size(); ++s) {
    if (im.header.slots[s] == data::kDarkSlot) continue;
    const cv::Vec3f c = 255.0F * kColours[s % kColours.size()];
    text(im.header.slots[s], x, total_height - 10, {c[0], c[1], c[2]});
    x += 24 + 9 * static_cast<int>(im.header.slots[s].size());
  }
  data::WriteTextFile(path, PngOf(page.data, static_cast<std::size_t>(page.rows),
                                  static_cast<std::size_t>(page.cols)));
}

}  // namespace unfurl::measure
