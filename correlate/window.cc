#include "correlate/window.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

namespace unfurl::correlate {

namespace {

std::span<const double> Terms(SpectralWindow window) {
  static constexpr double kOne[] = {1.0};
  static constexpr double kHann[] = {0.5, 0.5};
  static constexpr double kHamming[] = {0.54, 0.46};
  static constexpr double kBlackman[] = {0.42, 0.5, 0.08};
  static constexpr double kHarris[] = {0.35875, 0.48829, 0.14128, 0.01168};
  static constexpr double kFlat[] = {0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368};
  switch (window) {
    case SpectralWindow::kRectangular:
      return kOne;
    case SpectralWindow::kHann:
      return kHann;
    case SpectralWindow::kHamming:
      return kHamming;
    case SpectralWindow::kBlackman:
      return kBlackman;
    case SpectralWindow::kBlackmanHarris:
      return kHarris;
    case SpectralWindow::kFlatTop:
      return kFlat;
  }
  return kOne;
}

}  // namespace

const char* Name(SpectralWindow window) {
  switch (window) {
    case SpectralWindow::kRectangular:
      return "rectangular";
    case SpectralWindow::kHann:
      return "Hann";
    case SpectralWindow::kHamming:
      return "Hamming";
    case SpectralWindow::kBlackman:
      return "Blackman";
    case SpectralWindow::kBlackmanHarris:
      return "Blackman-Harris";
    case SpectralWindow::kFlatTop:
      return "flat-top";
  }
  return "";
}

std::vector<double> WindowValues(SpectralWindow window, std::size_t n) {
  const auto a = Terms(window);
  std::vector<double> w(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double x = 2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
    double sum = 0.0, sign = 1.0;
    for (std::size_t k = 0; k < a.size(); ++k, sign = -sign) {
      sum += sign * a[k] * std::cos(static_cast<double>(k) * x);
    }
    w[i] = sum;
  }
  return w;
}

double CoherentGain(SpectralWindow window) { return Terms(window)[0]; }

double NoiseBandwidth(SpectralWindow window) {
  const auto a = Terms(window);
  double square = a[0] * a[0];
  for (std::size_t k = 1; k < a.size(); ++k) square += 0.5 * a[k] * a[k];
  return square / (a[0] * a[0]);
}

double WindowResponse(SpectralWindow window, double bins) {
  const auto a = Terms(window);
  // Each term is a pair of sinc functions k bins to either side: the terms' own signs cancel those
  // of exp(i pi (x +- k)).
  auto sinc = [](double x) {
    const double y = std::numbers::pi * x;
    return std::abs(y) < 1e-9 ? 1.0 : std::sin(y) / y;
  };
  double sum = a[0] * sinc(bins);
  for (std::size_t k = 1; k < a.size(); ++k) {
    const auto at = static_cast<double>(k);
    sum += 0.5 * a[k] * (sinc(bins - at) + sinc(bins + at));
  }
  return std::abs(sum) / a[0];
}

double BinOffset(SpectralWindow window, double ratio) {
  if (window == SpectralWindow::kHann) {
    return std::clamp((2.0 * ratio - 1.0) / (ratio + 1.0), 0.0, 0.5);
  }
  if (window == SpectralWindow::kRectangular) return std::clamp(ratio / (1.0 + ratio), 0.0, 0.5);
  // The ratio rises from the sine on the bin to 1 half-way to its neighbour.
  double low = 0.0, high = 0.5;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    const double at = WindowResponse(window, 1.0 - middle) / WindowResponse(window, middle);
    (at < ratio ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace unfurl::correlate
