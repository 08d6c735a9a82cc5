#include "correlate/spectra/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/random.h"
#include "correlate/spectra/bridge.h"
#include "correlate/spectra/fft.h"

namespace unfurl::correlate::spectrum_test {
namespace {

constexpr double kTau = 2.0 * std::numbers::pi;
constexpr double kRoundOff = 1e-12;

std::vector<double> Sine(std::size_t n, double dt, double f, double amplitude, double phase = 0.3) {
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = amplitude * std::cos(kTau * f * dt * static_cast<double>(i) + phase);
  }
  return x;
}

TEST(Fft, ParsevalHoldsForEvenAndOddLengths) {
  Rng rng(1);
  for (std::size_t n : {8u, 9u, 500u, 501u, 997u}) {
    std::vector<double> x(n);
    double energy = 0.0;
    for (double& v : x) v = rng.Normal(), energy += v * v;
    const auto X = RealFft(x);
    double sum = std::norm(X[0]);
    for (std::size_t k = 1; k < X.size(); ++k) {
      sum += (n % 2 == 0 && k == n / 2 ? 1.0 : 2.0) * std::norm(X[k]);
    }
    EXPECT_NEAR(sum / static_cast<double>(n) / energy, 1.0, kRoundOff);
    const std::vector<double> back = InverseRealFft(X, n);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(back[i], x[i], kRoundOff);
  }
}

TEST(Fft, CrossCorrelationIsTheSumItSaysItIs) {
  Rng rng(2);
  std::vector<double> x(7), y(12);
  for (double& v : x) v = rng.Normal();
  for (double& v : y) v = rng.Normal();
  const std::vector<double> c = CrossCorrelation(x, y);
  ASSERT_EQ(c.size(), x.size() + y.size() - 1);
  for (int lag = -6; lag <= 11; ++lag) {
    double sum = 0.0;
    for (int i = 0; i < 7; ++i) {
      if (i + lag >= 0 && i + lag < 12) {
        sum += x[static_cast<std::size_t>(i)] * y[static_cast<std::size_t>(i + lag)];
      }
    }
    EXPECT_NEAR(c[static_cast<std::size_t>(lag + 6)], sum, kRoundOff);
  }
}

TEST(Spectrum, ASineOnABinShowsItsAmplitude) {
  for (std::size_t n : {400u, 401u}) {
    for (SpectralWindow window : {SpectralWindow::kRectangular, SpectralWindow::kHann}) {
      const double dt = 0.005, f = 24.0 / (static_cast<double>(n) * dt);
      const Spectrum s = AmplitudeSpectrum(Sine(n, dt, f, 0.7), dt, "m", {window, Detrend::kNone});
      EXPECT_EQ(s.frequency.size(), n / 2 + 1);
      EXPECT_NEAR(s.frequency[24], f, kRoundOff);
      EXPECT_NEAR(s.amplitude[24], 0.7, 1e-12);
      // Closed form: the Hann window's neighbours carry half of it, all others nothing.
      EXPECT_NEAR(s.amplitude[23], window == SpectralWindow::kHann ? 0.35 : 0.0, 1e-12);
      EXPECT_NEAR(s.amplitude[30], 0.0, 1e-12);
      EXPECT_NEAR(s.resolution, 1.0 / (static_cast<double>(n) * dt), kRoundOff);
      EXPECT_NEAR(s.noise_bandwidth / s.resolution, window == SpectralWindow::kHann ? 1.5 : 1.0,
                  1e-12);
    }
  }
}

TEST(Spectrum, TheNyquistBinAndTheMeanAreNotDoubled) {
  std::vector<double> x(64);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 2.0 + (i % 2 == 0 ? 0.5 : -0.5);
  const Spectrum s = AmplitudeSpectrum(x, 0.1, "m", {SpectralWindow::kRectangular, Detrend::kNone});
  EXPECT_NEAR(s.amplitude.front(), 2.0, kRoundOff);
  EXPECT_NEAR(s.amplitude.back(), 0.5, kRoundOff);
}

TEST(Spectrum, DetrendingTakesAStraightLineOutExactly) {
  std::vector<double> x(301);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 5.0 - 0.01 * static_cast<double>(i);
  const Spectrum s = AmplitudeSpectrum(x, 0.01, "m");
  for (double a : s.amplitude) EXPECT_NEAR(a, 0.0, kRoundOff);
}

TEST(Spectrum, PeaksLieBetweenTheBins) {
  const double dt = 0.005;
  for (std::size_t n : {800u, 801u}) {
    const double bin = 1.0 / (static_cast<double>(n) * dt);
    for (double part : {0.0, 0.1, 0.25, 0.5, 0.77, 0.99}) {
      const double f = (60.0 + part) * bin;
      const Spectrum s =
          AmplitudeSpectrum(Sine(n, dt, f, 0.02), dt, "m", {SpectralWindow::kHann, Detrend::kNone});
      const std::vector<Peak> peaks = FindPeaks(s);
      ASSERT_EQ(peaks.size(), 1u) << part;
      // The mirror image at -f leaks a little: it falls with the cube of the distance, 120 bins.
      EXPECT_NEAR(peaks[0].frequency, f, 1e-4 * bin);
      EXPECT_NEAR(peaks[0].amplitude, 0.02, 1e-4 * 0.02);
    }
  }
}

TEST(Spectrum, TwoSinesInNoiseAreTwoPeaksAndPureNoiseIsNone) {
  Rng rng(5);
  const double dt = 0.005;
  std::vector<double> x = Sine(1000, dt, 3.13, 0.01), y = Sine(1000, dt, 11.71, 0.004, 1.0);
  std::vector<double> noise(1000);
  for (std::size_t i = 0; i < x.size(); ++i) {
    noise[i] = 2e-4 * rng.Normal();
    x[i] += y[i] + noise[i];
  }
  const std::vector<Peak> peaks = FindPeaks(AmplitudeSpectrum(x, dt, "m"));
  ASSERT_EQ(peaks.size(), 2u);
  EXPECT_NEAR(peaks[0].frequency, 3.13, 0.01);
  EXPECT_NEAR(peaks[1].frequency, 11.71, 0.01);
  EXPECT_NEAR(peaks[0].amplitude, 0.01, 2e-4);
  EXPECT_TRUE(FindPeaks(AmplitudeSpectrum(noise, dt, "m")).empty());
}

TEST(Spectrum, PeaksArePairedOnceNearestFirst) {
  const std::vector<Peak> a = {{3.0, 1.0, 0}, {7.0, 1.0, 0}};
  const std::vector<Peak> b = {{3.3, 1.0, 0}, {3.1, 1.0, 0}, {20.0, 1.0, 0}};
  const std::vector<PeakPair> pairs = PairPeaks(a, b, 0.25);
  ASSERT_EQ(pairs.size(), 4u);
  EXPECT_EQ(pairs[0].b, 1);   // 3.0 with 3.1
  EXPECT_EQ(pairs[1].b, -1);  // 7.0 alone
  EXPECT_EQ(pairs[2].a, -1);
}

TEST(Spectrum, TooFewSamplesAreAnError) {
  const std::vector<double> x(5, 1.0);
  EXPECT_THROW(AmplitudeSpectrum(x, 0.1, "m"), Error);
}

// Two sines, one of three samples a period, and noise: what is put in for missing samples is off by
// little more than the noise, and spectra keep their peaks. (Without it the longest stretch, or
// Lomb-Scargle, took the place of the record.)
TEST(BridgeGaps, PutsInWhatIsMissing) {
  constexpr double kNoise = 1e-3;
  Rng rng(11);
  std::vector<double> t, x, all, ramp;
  for (int i = 0; i < 1200; ++i) {
    const double at = 5e-3 * i;
    all.push_back(3.0 + 0.5 * at + std::exp(-0.5 * at) * std::cos(8.0 * at) +
                  0.05 * std::cos(kTau * 66.0 * at) + kNoise * rng.Normal());
    if (i == 500 || (i > 700 && i < 709) || (i > 0 && i % 97 == 0)) continue;
    t.push_back(7.0 + at + 1e-5 * rng.Uniform());
    x.push_back(all.back());
    ramp.push_back(at);
  }
  const BridgedRecord whole = BridgeGaps(t, {x, ramp});
  ASSERT_EQ(whole.t.size(), all.size());
  EXPECT_EQ(whole.filled, all.size() - x.size());
  EXPECT_TRUE(LongestEvenStretch(whole.t).whole);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_NEAR(whole.x[0][i], all[i], 10.0 * kNoise) << i;
    EXPECT_NEAR(whole.x[1][i], 5e-3 * static_cast<double>(i), 1e-9) << i;
  }
  // More than a twentieth, or stamps on no grid: as given.
  std::vector<double> few_t, few_x, off = t;
  for (std::size_t i = 0; i < t.size(); ++i) {
    if (i < 200 || i > 300) few_t.push_back(t[i]), few_x.push_back(x[i]);
  }
  EXPECT_EQ(BridgeGaps(few_t, {few_x}).filled, 0u);
  EXPECT_EQ(BridgeGaps(few_t, {few_x}).x[0], few_x);
  for (std::size_t i = 0; i < off.size(); ++i) off[i] += 1e-3 * rng.Uniform();
  EXPECT_EQ(BridgeGaps(off, {x}).filled, 0u);
}

TEST(EvenStretch, StopsAtAGapAndSaysSo) {
  std::vector<double> t;
  for (int i = 0; i < 30; ++i) t.push_back(0.01 * i + (i >= 12 ? 0.05 : 0.0));
  const EvenStretch s = LongestEvenStretch(t);
  EXPECT_EQ(s.first, 12u);
  EXPECT_EQ(s.count, 18u);
  EXPECT_NEAR(s.dt, 0.01, kRoundOff);
  EXPECT_FALSE(s.whole);
}

}  // namespace
}  // namespace unfurl::correlate::spectrum_test
