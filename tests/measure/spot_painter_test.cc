#include "measure/spot_painter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "base/random.h"

namespace unfurl::measure::spot_painter_test {
namespace {

SpotLight OneBundle(double low, double high, double flux) {
  SpotLight spot;
  spot.count = 1;
  spot.bundles[0] = {low, high, flux};
  spot.flux = flux;
  spot.centre_px = 0.5 * (low + high);
  return spot;
}

TEST(SpotPainter, KeepsEveryElectron) {
  constexpr double kRoundOff = 1e-12;
  Rng rng(1);
  SpotPainter painter(0.85);
  for (int i = 0; i < 200; ++i) {
    SpotLight spot;
    double total = 0.0;
    for (spot.count = 0; spot.count < kSlitSamples; ++spot.count) {
      const double low = rng.Uniform(80.0, 100.0);
      const double flux = rng.Uniform();
      spot.bundles[static_cast<std::size_t>(spot.count)] = {low, low + rng.Uniform(0.0, 3.0), flux};
      total += flux;
    }
    std::vector<double> pixels(200, 0.0);
    painter.Add(spot, 7.0, pixels);
    EXPECT_NEAR(std::accumulate(pixels.begin(), pixels.end(), 0.0) / (7.0 * total), 1.0, kRoundOff);
  }
}

TEST(SpotPainter, KeepsTheCentroid) {
  // Pixels sample the blurred light: its aliasing is exp(-2 pi^2 sigma^2) with the light's whole
  // width, below 1e-6 px from 0.85 px on.
  constexpr double kAliasing = 2e-6;
  SpotPainter painter(0.85);
  for (double phase = 0.0; phase < 1.0; phase += 0.0371) {
    for (const double width : {0.0, 1e-7, 0.02, 0.4, 6.3}) {
      std::vector<double> pixels(60, 0.0);
      painter.Add(OneBundle(30.0 + phase, 30.0 + phase + width, 1.0), 1.0, pixels);
      double centre = 0.0;
      for (int k = 0; k < 60; ++k) centre += k * pixels[static_cast<std::size_t>(k)];
      EXPECT_NEAR(centre, 30.0 + phase + 0.5 * width, kAliasing);
    }
  }
}

TEST(SpotPainter, VarianceIsTheSumOfItsParts) {
  // Blur, pixel (1/12), bundle (w^2/12), and the grid's own hat (1/6 of its step squared).
  constexpr double kStep = 1.0 / 16.0;
  SpotPainter painter(1.2);
  std::vector<double> pixels(80, 0.0);
  painter.Add(OneBundle(37.0, 40.0, 1.0), 1.0, pixels);
  double second = 0.0;
  for (int k = 0; k < 80; ++k)
    second += (k - 38.5) * (k - 38.5) * pixels[static_cast<std::size_t>(k)];
  EXPECT_NEAR(second, 1.44 + 1.0 / 12.0 + 9.0 / 12.0, kStep * kStep / 6.0 + 1e-6);
}

TEST(SpotPainter, LightBesideTheSensorIsLost) {
  SpotPainter painter(0.85);
  std::vector<double> pixels(50, 0.0);
  painter.Add(OneBundle(-0.5, -0.5, 1.0), 1.0, pixels);
  // The sensor begins at -0.5: half of the light falls on it.
  EXPECT_NEAR(std::accumulate(pixels.begin(), pixels.end(), 0.0), 0.5, 1e-9);
  std::fill(pixels.begin(), pixels.end(), 0.0);
  painter.Add(OneBundle(70.0, 72.0, 1.0), 1.0, pixels);
  EXPECT_EQ(std::accumulate(pixels.begin(), pixels.end(), 0.0), 0.0);
}

}  // namespace
}  // namespace unfurl::measure::spot_painter_test
