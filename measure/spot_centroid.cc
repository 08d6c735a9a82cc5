#include <algorithm>
#include <cmath>
#include <numbers>

#include "measure/spot_fit.h"

namespace unfurl::measure {

void ReadCentroid(std::span<const float> counts, int first, const PixelNoise& noise,
                  const SpotOptions& options, Spot* spot) {
  constexpr float kShare = 0.1F;           // of the peak, that a value must exceed to count
  constexpr float kSigmas = 4.0F;          // and this many of the dark noise
  constexpr double kQuantum = 1.0 / 12.0;  // variance of a uniform pixel [px^2]
  const bool squared = options.estimator == SpotEstimator::kSquaredCentroid;
  const int n = static_cast<int>(counts.size());
  int summit = -1;
  for (int k = 0; k < n; ++k) {
    if (summit < 0 ||
        counts[static_cast<std::size_t>(k)] > counts[static_cast<std::size_t>(summit)]) {
      summit = k;
    }
  }
  const float* d = counts.data();
  const float peak = d[summit];
  const float sigma = static_cast<float>(std::sqrt(noise.dark_variance));
  // Squares make small values count for little by themselves.
  const float floor = squared ? std::max(0.02F * peak, 1.5F * sigma)
                              : std::max(kShare * peak, std::min(kSigmas * sigma, 0.5F * peak));
  int low = summit, high = summit;
  while (low > 0 && d[low - 1] > floor) --low;
  while (high < n - 1 && d[high + 1] > floor) ++high;

  double sum = 0.0, by_k = 0.0, by_square = 0.0, flux = 0.0;
  for (int k = low; k <= high; ++k) {
    const double at = k - summit;
    const double w = squared ? static_cast<double>(d[k]) * d[k] : static_cast<double>(d[k] - floor);
    flux += d[k];
    sum += w;
    by_k += w * at;
    by_square += w * at * at;
  }
  const double mean = by_k / sum;
  double variance = 0.0;
  for (int k = low; k <= high; ++k) {
    const double slope = (squared ? 2.0 * d[k] : 1.0) * (k - summit - mean) / sum;
    variance +=
        slope * slope * (noise.dark_variance + std::max(0.0F, d[k]) / noise.electrons_per_count);
  }
  // A square is narrower by the root of two, what stands above a tenth by 0.82; one pixel's own
  // width is not the spot's.
  const double second = std::max(0.0, by_square / sum - mean * mean);
  const double wider = squared ? 2.0 : 1.0 / (0.82 * 0.82);
  const double width = std::sqrt(std::max(kQuantum, wider * second - kQuantum));
  // What the place within a pixel adds to a narrow spot's centroid, by measurement (spot_bench).
  const double phase = squared ? std::exp(-std::numbers::pi * std::numbers::pi * width * width)
                               : 0.016 / (1.0 + std::pow(width / 1.6, 3.0));
  spot->u_px = first + summit + mean;
  spot->s_px = std::sqrt(variance + phase * phase);
  spot->width_px = width;
  spot->flux = flux;
  if (high == low) spot->flags |= kSpotPoorFit;  // one pixel: the place within it is unknown
}

}  // namespace unfurl::measure
