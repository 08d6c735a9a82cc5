#include "measure/background.h"

#include <algorithm>
#include <cmath>

#include "measure/float_pack.h"

namespace unfurl::measure {

Background::Background(const data::LineFormat& format)
    : format_(format),
      mean_(static_cast<std::size_t>(format.active), 0.0F),
      pattern_(mean_.size(), 0) {
  scratch_.reserve(kSample + 1);
}

std::array<float, 2> Background::Shielded(std::span<const std::uint16_t> line) const {
  const std::size_t before = static_cast<std::size_t>(format_.dummy);
  const std::size_t active = format_.first_active();
  const std::size_t after = active + mean_.size();
  std::uint32_t sum[2] = {0, 0}, count[2] = {0, 0};
  const auto add = [&](std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; ++k) sum[k & 1U] += line[k];
    count[0] += static_cast<std::uint32_t>((to + 1) / 2 - (from + 1) / 2);
    count[1] += static_cast<std::uint32_t>(to / 2 - from / 2);
  };
  add(before, active);
  add(after, after + static_cast<std::size_t>(format_.dark_after));
  const std::size_t first = active & 1U;
  if (count[0] == 0 || count[1] == 0) {
    // Too few to tell the registers apart.
    const std::uint32_t all = std::max(1U, count[0] + count[1]);
    const float mean = static_cast<float>(sum[0] + sum[1]) / static_cast<float>(all);
    return {mean, mean};
  }
  return {static_cast<float>(sum[first]) / static_cast<float>(count[first]),
          static_cast<float>(sum[1 - first]) / static_cast<float>(count[1 - first])};
}

std::array<float, 2> Background::Levels(std::span<const std::uint16_t> line) const {
  const std::array<float, 2> shielded = Shielded(line);
  return {shielded[0] - level_[0], shielded[1] - level_[1]};
}

double Background::mean_variance() const {
  return lines_ == 0 ? 0.0 : 1.0 / std::min(lines_, kMemory);
}

void Background::Add(std::span<const std::uint16_t> dark_line) {
  if (lines_ == 0) level_ = Shielded(dark_line);
  const std::array<float, 2> shift = Levels(dark_line);
  const std::uint16_t* active = dark_line.data() + format_.first_active();
  const std::size_t n = mean_.size();
  if (lines_ > 0) {
    // The median of |difference| is 0.6745 sigma; a passing light does not move it. Light that
    // falls on all elements alike, such as a lamp's flicker, is no noise of theirs.
    const std::size_t stride = std::max<std::size_t>(1, n / kSample);
    scratch_.clear();
    for (std::size_t k = static_cast<std::size_t>(lines_) % stride;
         k < n && scratch_.size() < kSample; k += stride) {
      scratch_.push_back(static_cast<float>(active[k]) - shift[k & 1U] - mean_[k]);
    }
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    const float centre = *middle;
    for (float& x : scratch_) x = std::abs(x - centre);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    const double sigma = *middle / 0.674489750196082 / std::sqrt(1.0 + mean_variance());
    const double weight = 1.0 / std::min(lines_, kMemory);
    noise_ += weight * (sigma - noise_);
  }
  ++lines_;
  const float weight = 1.0F / static_cast<float>(std::min(lines_, kMemory));
  std::size_t k = 0;
  FloatPack lowest = InTurn(1e9F, 1e9F);
  const FloatPack shifts = InTurn(shift[0], shift[1]);
  for (; k + kFloats <= n; k += kFloats) {
    FloatPack mean = Load(&mean_[k]);
    mean += weight * (Load(active + k) - shifts - mean);
    lowest = Min(lowest, mean);
    Store(mean, &mean_[k]);
  }
  lowest_ = -Highest(-lowest);
  for (; k < n; ++k) {
    mean_[k] += weight * (static_cast<float>(active[k]) - shift[k & 1U] - mean_[k]);
    lowest_ = std::min(lowest_, mean_[k]);
  }
  const float rounding = 0.5F - lowest_;
  for (k = 0; k + kFloats <= n; k += kFloats) Store(Load(&mean_[k]) + rounding, &pattern_[k]);
  for (; k < n; ++k) pattern_[k] = static_cast<std::uint16_t>(mean_[k] + rounding);
}

}  // namespace unfurl::measure
