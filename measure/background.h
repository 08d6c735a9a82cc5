#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "data/line_format.h"

namespace unfurl::measure {

// What one camera's elements count with no LED lit: a running mean of dark lines, element by
// element, each line first brought to the level of its own shielded elements.
class Background {
 public:
  explicit Background(const data::LineFormat& format);

  void Add(std::span<const std::uint16_t> dark_line);

  bool empty() const { return lines_ == 0; }
  // Mean of the shielded elements of a line above that of the mean: the level's drift [count].
  double Level(std::span<const std::uint16_t> line) const;
  // Of the active pixels [count].
  std::span<const float> mean() const { return mean_; }
  // Variance of the mean of one element over the variance of one element [-].
  double mean_variance() const;
  // Standard deviation of one active element in the dark, as the lines themselves show it, freed
  // from outliers [count]; 0 with fewer than two lines.
  double noise() const { return noise_; }

 private:
  double Shielded(std::span<const std::uint16_t> line) const;

  // A mean over more lines gains nothing on a reading and follows drift more slowly.
  static constexpr int kMemory = 256;

  data::LineFormat format_;
  std::vector<float> mean_;
  double level_ = 0.0;
  int lines_ = 0;
  double noise_ = 0.0;
  std::vector<float> scratch_;
};

}  // namespace unfurl::measure
