#include "measure/spot_painter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::measure {

namespace {

double LightBelow(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

// Integral of the hat function of half width one from -infinity to t.
double HatIntegral(double t) {
  if (t <= -1.0) return 0.0;
  if (t >= 1.0) return 1.0;
  return t < 0.0 ? 0.5 * (1.0 + t) * (1.0 + t) : 1.0 - 0.5 * (1.0 - t) * (1.0 - t);
}

}  // namespace

SpotPainter::SpotPainter(double blur_px) {
  constexpr double kTail = 6.0;  // sigmas kept: 2e-9 of the light lies beyond
  reach_ = static_cast<int>(std::ceil(kTail * blur_px + 1.0));
  const int width = 2 * reach_ + 1;
  kernel_.resize(static_cast<std::size_t>(kFine * width));
  for (int phase = 0; phase < kFine; ++phase) {
    double* row = &kernel_[static_cast<std::size_t>(phase * width)];
    double sum = 0.0;
    for (int k = -reach_; k <= reach_; ++k) {
      const double d = k - static_cast<double>(phase) / kFine;
      row[k + reach_] = LightBelow((d + 0.5) / blur_px) - LightBelow((d - 0.5) / blur_px);
      sum += row[k + reach_];
    }
    for (int k = 0; k < width; ++k) row[k] /= sum;
  }
}

void SpotPainter::Add(const SpotLight& spot, double scale, std::span<double> pixels) {
  double low = spot.bundles[0].low;
  double high = spot.bundles[0].high;
  for (int i = 1; i < spot.count; ++i) {
    low = std::min(low, spot.bundles[static_cast<std::size_t>(i)].low);
    high = std::max(high, spot.bundles[static_cast<std::size_t>(i)].high);
  }
  const int first = static_cast<int>(std::floor(low)) - 1;
  const int last = static_cast<int>(std::ceil(high)) + 1;
  grid_.assign(static_cast<std::size_t>((last - first + 1) * kFine), 0.0);

  for (int i = 0; i < spot.count; ++i) {
    const Bundle& b = spot.bundles[static_cast<std::size_t>(i)];
    const double a0 = (b.low - first) * kFine;
    const double a1 = (b.high - first) * kFine;
    const double width = a1 - a0;
    const int j0 = static_cast<int>(std::floor(a0));
    const int j1 = static_cast<int>(std::ceil(a1));
    if (width < 1e-6) {
      const double share = a0 - j0;
      grid_[static_cast<std::size_t>(j0)] += b.flux * (1.0 - share);
      grid_[static_cast<std::size_t>(j0 + 1)] += b.flux * share;
      continue;
    }
    for (int j = j0; j <= j1; ++j) {
      grid_[static_cast<std::size_t>(j)] +=
          b.flux / width * (HatIntegral(a1 - j) - HatIntegral(a0 - j));
    }
  }

  const int width = 2 * reach_ + 1;
  const int count = static_cast<int>(pixels.size());
  for (std::size_t j = 0; j < grid_.size(); ++j) {
    if (grid_[j] == 0.0) continue;
    const double light = scale * grid_[j];
    const int pixel = first + static_cast<int>(j) / kFine;
    const double* row = &kernel_[(j % kFine) * static_cast<std::size_t>(width)];
    const int from = std::max(-reach_, -pixel);
    const int to = std::min(reach_, count - 1 - pixel);
    for (int k = from; k <= to; ++k) {
      pixels[static_cast<std::size_t>(pixel + k)] += light * row[k + reach_];
    }
  }
}

}  // namespace unfurl::measure
