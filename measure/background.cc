#include "measure/background.h"

#include <algorithm>
#include <cmath>

namespace unfurl::measure {

Background::Background(const data::LineFormat& format)
    : format_(format),
      mean_(static_cast<std::size_t>(format.active), 0.0F),
      scratch_(static_cast<std::size_t>(format.active)) {}

double Background::Shielded(std::span<const std::uint16_t> line) const {
  const std::size_t before = static_cast<std::size_t>(format_.dummy);
  const std::size_t dark = static_cast<std::size_t>(format_.dark);
  const std::size_t after = format_.first_active() + static_cast<std::size_t>(format_.active);
  const std::size_t dark_after = static_cast<std::size_t>(format_.dark_after);
  std::uint32_t sum = 0;
  for (std::size_t k = before; k < before + dark; ++k) sum += line[k];
  for (std::size_t k = after; k < after + dark_after; ++k) sum += line[k];
  return dark + dark_after == 0 ? 0.0 : sum / static_cast<double>(dark + dark_after);
}

double Background::Level(std::span<const std::uint16_t> line) const {
  return Shielded(line) - level_;
}

double Background::mean_variance() const {
  return lines_ == 0 ? 0.0 : 1.0 / std::min(lines_, kMemory);
}

void Background::Add(std::span<const std::uint16_t> dark_line) {
  const double shielded = Shielded(dark_line);
  if (lines_ == 0) level_ = shielded;
  const float shift = static_cast<float>(shielded - level_);
  const std::uint16_t* active = dark_line.data() + format_.first_active();
  if (lines_ > 0) {
    // The median of |difference| is 0.6745 sigma; a passing light does not move it.
    for (std::size_t k = 0; k < mean_.size(); ++k) {
      scratch_[k] = std::abs(static_cast<float>(active[k]) - shift - mean_[k]);
    }
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    const double sigma = *middle / 0.674489750196082 / std::sqrt(1.0 + mean_variance());
    const double weight = 1.0 / std::min(lines_, kMemory);
    noise_ += weight * (sigma - noise_);
  }
  ++lines_;
  const float weight = 1.0F / static_cast<float>(std::min(lines_, kMemory));
  for (std::size_t k = 0; k < mean_.size(); ++k) {
    mean_[k] += weight * (static_cast<float>(active[k]) - shift - mean_[k]);
  }
}

}  // namespace unfurl::measure
