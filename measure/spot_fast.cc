// Lines in, readings out, at the speed of memory; compiled for this machine's vectors.
#include <algorithm>
#include <cmath>
#include <limits>

#include "measure/float_pack.h"
#include "measure/spot_fit.h"

namespace unfurl::measure {

namespace {

constexpr int kSpotFastBlock = 2 * kCounts;  // pixels of a block: two packs
// The highest of 64 normal values lies this many sigmas above their mean, half of the time more.
constexpr float kHighest = 2.3F;

std::uint16_t MiddleOf(std::uint16_t a, std::uint16_t b, std::uint16_t c) {
  return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

// About the median of n values: of 27 spread over them, middles of three, three times. A quarter of
// them may be lit.
std::uint16_t MiddleOf(const std::uint16_t* values, int n) {
  std::uint16_t nine[9];
  for (int i = 0; i < 9; ++i) {
    const int at = 3 * i;
    nine[i] = MiddleOf(values[at * n / 27], values[(at + 1) * n / 27], values[(at + 2) * n / 27]);
  }
  return MiddleOf(MiddleOf(nine[0], nine[3], nine[6]), MiddleOf(nine[1], nine[4], nine[7]),
                  MiddleOf(nine[2], nine[5], nine[8]));
}

// The highest signal of each block of kBlock pixels.
inline void HighestOfBlocks(const std::uint16_t* counts, const std::uint16_t* pattern, int n,
                            std::uint16_t* highest) {
  const int whole = n / kSpotFastBlock;
  for (int b = 0; b < whole; ++b) {
    const std::uint16_t* c = counts + b * kSpotFastBlock;
    const std::uint16_t* p = pattern + b * kSpotFastBlock;
    highest[b] = Highest(
        Max(Above(LoadWide(c), LoadWide(p)), Above(LoadWide(c + kCounts), LoadWide(p + kCounts))));
  }
  if (whole * kSpotFastBlock == n) return;
  int highest_left = 0;
  for (int k = whole * kSpotFastBlock; k < n; ++k) {
    highest_left = std::max(highest_left, counts[k] - pattern[k]);
  }
  highest[whole] = static_cast<std::uint16_t>(highest_left);
}

// The end of a spot in one direction: where its signal falls below the foot, or the valley from
// which it rises again to a neighbour, which is flagged.
template <typename Signal>
inline int EndOfSpot(const Signal& signal, int summit, int step, int n, float foot, float rise,
                     Spot* spot) {
  int k = summit;
  float lowest = signal(k);
  int lowest_at = k;
  while (k + step >= 0 && k + step < n) {
    const float v = signal(k);
    if (v < foot) break;
    if (v < lowest) lowest = v, lowest_at = k;
    if (v > lowest + rise) {
      spot->flags |= kSpotOverlap;
      return lowest_at;
    }
    k += step;
  }
  return k;
}

}  // namespace

// The signal is looked at once, in whole counts, by the highest value of each block. The level is
// taken from the line itself: the median of those.
Spot SpotFinder::FindFast(std::span<const std::uint16_t> line, const Background& background) {
  Spot spot;
  const int n = format_.active;
  const std::uint16_t* counts = line.data() + format_.first_active();
  const std::uint16_t* pattern = background.pattern().data();
  const int blocks = (n + kSpotFastBlock - 1) / kSpotFastBlock;
  constexpr int kMostBlocks = 2048;  // 131,072 pixels; a format has 100,000 at most
  std::uint16_t highest[kMostBlocks];
  HighestOfBlocks(counts, pattern, n, highest);
  const double modelled =
      std::sqrt(format_.read_noise_counts * format_.read_noise_counts + 1.0 / 12.0);
  const float sigma = static_cast<float>(std::max(modelled, background.noise()));
  const float base = static_cast<float>(MiddleOf(highest, blocks)) - kHighest * sigma;
  const float threshold = base + static_cast<float>(options_.threshold) * sigma;
  const int top = static_cast<int>(std::max_element(highest, highest + blocks) - highest);
  const std::uint16_t summit_value = highest[top];
  if (!(static_cast<float>(summit_value) > threshold)) return spot;

  int summit = top * kSpotFastBlock;
  while (counts[summit] - pattern[summit] != summit_value) ++summit;
  const float* mean = background.mean().data();
  const float level = base - background.lowest();
  const float peak = static_cast<float>(summit_value) - base;
  const float foot = std::max(0.05F * peak, 2.0F * sigma);
  float* d = signal_.data();
  const auto signal = [&](int k) { return static_cast<float>(counts[k]) - mean[k] - level; };
  spot.flags = 0;
  const float rise = static_cast<float>(
      options_.threshold *
      std::sqrt(2.0F * (sigma * sigma + peak / static_cast<float>(format_.electrons_per_count))));
  const int low = EndOfSpot(signal, summit, -1, n, foot, rise, &spot);
  const int high = EndOfSpot(signal, summit, 1, n, foot, rise, &spot);
  for (int k = low; k <= high; ++k) {
    d[k] = signal(k);
    if (!inverse_response_.empty()) d[k] *= inverse_response_[static_cast<std::size_t>(k)];
    if (counts[k] >= full_) spot.flags |= kSpotSaturated;
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
  const int lit = static_cast<int>(threshold);
  bool second = false;
  for (int b = 0; b < low / kSpotFastBlock; ++b) second |= highest[b] > lit;
  for (int b = high / kSpotFastBlock + 1; b < blocks; ++b) second |= highest[b] > lit;
  if (second) spot.flags |= kSpotSecond;
  return spot;
}

}  // namespace unfurl::measure
