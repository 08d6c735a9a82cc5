#pragma once

#include <cmath>
#include <cstddef>
#include <map>

namespace unfurl {

// The median of a stream of positive numbers to 0.5%, whatever their size, in memory that grows
// with the logarithm of their range alone.
class StreamMedian {
 public:
  void Add(double value) {
    if (!(value > 0.0) || !std::isfinite(value)) return;
    ++counts_[static_cast<int>(std::floor(std::log(value) / kStep))];
    ++total_;
  }
  // 0 where nothing was added.
  double Get() const {
    std::size_t below = 0;
    for (const auto& [bin, count] : counts_) {
      below += count;
      if (2 * below >= total_) return std::exp(kStep * (bin + 0.5));
    }
    return 0.0;
  }

 private:
  static constexpr double kStep = 0.01;  // width of a bin, of the logarithm [-]
  std::map<int, std::size_t> counts_;
  std::size_t total_ = 0;
};

}  // namespace unfurl
