// Lines in, readings out, at the speed of memory; compiled for this machine's vectors.
#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/spot_fit.h"

namespace unfurl::measure {

namespace {

constexpr int kBlock = 64;
// The highest of 64 normal values lies this many sigmas above their mean, half of the time more.
constexpr float kHighest = 2.3F;

}  // namespace

// The signal is looked at once, in whole counts, by the highest value of each block. The level is
// taken from the line itself: the median of those.
Spot SpotFinder::FindFast(std::span<const std::uint16_t> line, const Background& background) {
  Spot spot;
  const int n = format_.active;
  const std::uint16_t* counts = line.data() + format_.first_active();
  const std::uint16_t* pattern = background.pattern().data();
  const int blocks = (n + kBlock - 1) / kBlock;
  constexpr int kMostBlocks = 2048;
  std::uint16_t highest[kMostBlocks], sorted[kMostBlocks];
  const int whole = n / kBlock;
  for (int b = 0; b < whole; ++b) {
    const std::uint16_t* c = counts + b * kBlock;
    const std::uint16_t* p = pattern + b * kBlock;
    std::uint16_t top = 0;
    for (int j = 0; j < kBlock; ++j) {
      const std::uint16_t v =
          c[j] > p[j] ? static_cast<std::uint16_t>(c[j] - p[j]) : std::uint16_t{0};
      top = v > top ? v : top;
    }
    highest[b] = top;
  }
  if (whole < blocks) {
    std::uint16_t top = 0;
    for (int k = whole * kBlock; k < n; ++k) {
      const int v = counts[k] - pattern[k];
      if (v > top) top = static_cast<std::uint16_t>(v);
    }
    highest[whole] = top;
  }
  std::copy(highest, highest + blocks, sorted);
  std::nth_element(sorted, sorted + blocks / 2, sorted + blocks);
  const double modelled =
      std::sqrt(format_.read_noise_counts * format_.read_noise_counts + 1.0 / 12.0);
  const float sigma = static_cast<float>(std::max(modelled, background.noise()));
  const float base = static_cast<float>(sorted[blocks / 2]) - kHighest * sigma;
  const float threshold = base + static_cast<float>(options_.threshold) * sigma;
  const int top = static_cast<int>(std::max_element(highest, highest + blocks) - highest);
  const std::uint16_t summit_value = highest[top];
  if (!(static_cast<float>(summit_value) > threshold)) return spot;

  int summit = top * kBlock;
  while (counts[summit] - pattern[summit] != summit_value) ++summit;
  const float* mean = background.mean().data();
  const float level = base - background.lowest();
  const float peak = static_cast<float>(summit_value) - base;
  const float foot = std::max(0.05F * peak, 2.0F * sigma);
  float* d = signal_.data();
  const int full = static_cast<int>(format_.full_scale());
  const auto signal = [&](int k) { return static_cast<float>(counts[k]) - mean[k] - level; };
  spot.flags = 0;
  const float rise = static_cast<float>(
      options_.threshold *
      std::sqrt(2.0F * (sigma * sigma + peak / static_cast<float>(format_.electrons_per_count))));
  const auto walk = [&](int step) {
    int k = summit;
    float lowest = signal(k);
    int lowest_at = k;
    while (k + step >= 0 && k + step < n) {
      const float v = signal(k);
      if (v < foot) break;
      if (v < lowest) lowest = v, lowest_at = k;
      if (v > lowest + rise) {
        spot.flags |= kSpotOverlap;
        return lowest_at;
      }
      k += step;
    }
    return k;
  };
  const int low = walk(-1), high = walk(1);
  for (int k = low; k <= high; ++k) {
    d[k] = signal(k);
    if (!inverse_response_.empty()) d[k] *= inverse_response_[static_cast<std::size_t>(k)];
    if (counts[k] >= full) spot.flags |= kSpotSaturated;
  }
  ReadCentroid({d + low, static_cast<std::size_t>(high - low + 1)}, low,
               {.electrons_per_count = format_.electrons_per_count,
                .dark_variance = sigma * sigma * (1.0 + background.mean_variance())},
               options_, &spot);
  constexpr double kInside = 2.0;  // widths from the edge that a whole spot keeps
  if (low == 0 || high == n - 1 || spot.u_px < kInside * spot.width_px ||
      spot.u_px > n - 1 - kInside * spot.width_px) {
    spot.flags |= kSpotEdge;
  }
  for (int b = 0; b < blocks; ++b) {
    if (static_cast<float>(highest[b]) > threshold &&
        ((b + 1) * kBlock <= low || b * kBlock > high)) {
      spot.flags |= kSpotSecond;
    }
  }
  return spot;
}

}  // namespace unfurl::measure
