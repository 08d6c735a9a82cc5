#include "measure/spot.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace unfurl::measure {

SpotFinder::SpotFinder(const data::LineFormat& format, const SpotOptions& options)
    : format_(format),
      options_(options),
      signal_(static_cast<std::size_t>(format.active)),
      sums_(static_cast<std::size_t>(format.active)) {}

Spot SpotFinder::Find(std::span<const std::uint16_t> line, const Background& background) {
  constexpr int kMargin = 5;       // pixels of background on either side of a spot
  constexpr double kFoot = 0.05;   // of the highest sum: where a spot is taken to end
  constexpr double kDip = 6.0;     // sigmas by which a second hill must rise
  constexpr double kInside = 2.0;  // widths from the edge that a whole spot keeps

  Spot spot;
  const int n = format_.active;
  const std::uint16_t* counts = line.data() + format_.first_active();
  const float* mean = background.mean().data();
  const float level = static_cast<float>(background.Level(line));
  float* d = signal_.data();
  float* m = sums_.data();
  for (int k = 0; k < n; ++k) d[k] = static_cast<float>(counts[k]) - mean[k] - level;
  m[0] = m[1] = m[n - 2] = m[n - 1] = 0.0F;
  float highest = 0.0F;
  for (int k = 2; k < n - 2; ++k) {
    m[k] = (d[k - 2] + d[k - 1]) + (d[k + 1] + d[k + 2]) + d[k];
    highest = std::max(highest, m[k]);
  }
  // Spots cut by an edge still have a foot inside; let the outermost sums tell.
  m[0] = m[1] = m[2];
  m[n - 1] = m[n - 2] = m[n - 3];

  const double modelled = std::sqrt(format_.read_noise_counts * format_.read_noise_counts +
                                    1.0 / 12.0);  // quantisation
  const double sigma = std::max(modelled, background.noise());
  const double dark_variance = sigma * sigma * (1.0 + background.mean_variance());
  const double sum_sigma = std::sqrt(5.0 * dark_variance);
  const double threshold = options_.threshold * sum_sigma;
  if (highest < threshold) return spot;
  spot.flags = 0;

  // Out from the summit to the foot on either side; a second rise on the way is another spot.
  const int summit = static_cast<int>(std::find(m, m + n, highest) - m);
  const float foot = static_cast<float>(std::max(kFoot * highest, 0.5 * threshold));
  const float rise = static_cast<float>(
      kDip * std::sqrt(sum_sigma * sum_sigma + highest / format_.electrons_per_count));
  const auto walk = [&](int step) {
    int k = summit;
    int lowest = summit;
    while (k + step >= 0 && k + step < n && m[k] > foot) {
      k += step;
      if (m[k] < m[lowest]) lowest = k;
      if (m[k] > m[lowest] + rise) {
        spot.flags |= kSpotOverlap;
        return lowest;
      }
    }
    return k;
  };
  const int low = walk(-1);
  const int high = walk(1);

  double sum = 0.0, first = 0.0, second = 0.0;
  for (int k = low; k <= high; ++k) {
    const double light = std::max(0.0F, d[k]);
    sum += light;
    first += light * k;
    second += light * k * k;
  }
  spot.u_px = first / sum;
  spot.width_px = std::sqrt(std::max(0.3, second / sum - spot.u_px * spot.u_px));

  const bool overlap = (spot.flags & kSpotOverlap) != 0;
  const int from = std::max(0, low - (overlap ? 0 : kMargin));
  const int to = std::min(n - 1, high + (overlap ? 0 : kMargin));
  const double full = format_.full_scale() - 0.5;
  for (int k = from; k <= to; ++k) {
    if (counts[k] > full) {
      d[k] = std::numeric_limits<float>::quiet_NaN();
      spot.flags |= kSpotSaturated;
    }
  }
  FitGaussian({d + from, static_cast<std::size_t>(to - from + 1)}, from,
              {.electrons_per_count = format_.electrons_per_count, .dark_variance = dark_variance},
              options_, &spot);
  if (spot.u_px < kInside * spot.width_px || spot.u_px > n - 1 - kInside * spot.width_px) {
    spot.flags |= kSpotEdge;
  }
  for (int k = 2; k < n - 2; ++k) {
    if ((k < from - 2 || k > to + 2) && m[k] > threshold) {
      spot.flags |= kSpotSecond;
      break;
    }
  }
  return spot;
}

}  // namespace unfurl::measure
