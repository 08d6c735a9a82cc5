#include "base/fixed_number.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl {

std::string FixedNumber(double value, int decimals) {
  constexpr int kMost = 15;  // what a double holds below one
  const double size = std::abs(value);
  if (size > 0.0 && size < 0.1) {
    const int zeros = -static_cast<int>(std::floor(std::log10(size)));
    decimals = std::min(decimals - 1 + zeros, kMost);
  }
  return fmt::format("{:.{}f}", value, decimals);
}

}  // namespace unfurl
