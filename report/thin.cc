#include "report/thin.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace unfurl::report {

std::vector<std::size_t> LeastAndMost(std::span<const double> values, std::size_t most) {
  std::vector<std::size_t> out;
  const std::size_t count = values.size();
  if (count <= most) {
    out.resize(count);
    std::iota(out.begin(), out.end(), 0U);
    return out;
  }
  // Three of each stretch: the least, the largest, and a gap.
  const std::size_t stretches = std::max<std::size_t>(1, (most - 2) / 3);
  out.push_back(0);
  for (std::size_t k = 0; k < stretches; ++k) {
    const std::size_t from = 1 + k * (count - 2) / stretches;
    const std::size_t to = 1 + (k + 1) * (count - 2) / stretches;
    std::size_t low = to, high = to, gap = to;
    for (std::size_t i = from; i < to; ++i) {
      if (std::isnan(values[i])) {
        gap = i;
        continue;
      }
      if (low == to || values[i] < values[low]) low = i;
      if (high == to || values[i] > values[high]) high = i;
    }
    std::vector<std::size_t> kept = {low, high, gap};
    std::sort(kept.begin(), kept.end());
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    for (const std::size_t i : kept) {
      if (i < to) out.push_back(i);
    }
  }
  out.push_back(count - 1);
  return out;
}

}  // namespace unfurl::report
