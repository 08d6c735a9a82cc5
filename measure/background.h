#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "data/line_format.h"

namespace unfurl::measure {

// What one camera's elements count with no LED lit: a running mean of dark lines, element by
// element, each line first brought to the level of its own shielded elements. Odd and even elements
// come through two registers, each with a level of its own.
class Background {
 public:
  explicit Background(const data::LineFormat& format);

  // A line of all elements.
  void Add(std::span<const std::uint16_t> dark_line);

  bool empty() const { return lines_ == 0; }  // no line yet
  // Mean of the shielded elements of a line above that of the mean, of the register of active
  // pixels 0, 2, .. and of 1, 3, ..: the levels' drift [count].
  std::array<float, 2> Levels(std::span<const std::uint16_t> line) const;
  // Of the active pixels [count].
  std::span<const float> mean() const { return mean_; }
  // The mean above its lowest value, rounded, and that value [count].
  std::span<const std::uint16_t> pattern() const { return pattern_; }
  float lowest() const { return lowest_; }
  // Variance of the mean of one element over the variance of one element [-].
  double mean_variance() const;
  // Standard deviation of one active element in the dark, as the lines themselves show it, freed
  // from outliers and from what moves all elements alike [count]; 0 with fewer than two lines.
  double noise() const { return noise_; }

 private:
  // Mean of the shielded elements by register, in the order of the active pixels.
  std::array<float, 2> Shielded(std::span<const std::uint16_t> line) const;

  // A mean over more lines gains nothing on a reading and follows drift more slowly.
  static constexpr int kMemory = 256;
  // Elements per line that the noise is learned from, another set in each.
  static constexpr std::size_t kSample = 135;
  static constexpr int kEarly = 64;  // lines that all count for the noise
  static constexpr int kSeldom = 8;  // of the later ones, each of so many

  data::LineFormat format_;
  std::vector<float> mean_;  // of the dark lines, by active pixel [count]
  std::vector<std::uint16_t> pattern_;
  float lowest_ = 0.0F;           // of mean_ [count]
  std::array<float, 2> level_{};  // of the shielded elements in the mean, by register [count]
  int lines_ = 0;
  double noise_ = 0.0;          // see noise() [count]
  std::vector<float> scratch_;  // of one line, in the making of the noise [count]
};

}  // namespace unfurl::measure
