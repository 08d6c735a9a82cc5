#include "correlate/spectra/spectral_density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/random.h"
#include "base/statistics.h"
#include "correlate/spectra/lomb_scargle.h"

namespace unfurl::correlate::spectral_density_test {
namespace {

constexpr double kTau = 2.0 * std::numbers::pi;
constexpr double kRoundOff = 1e-12;
constexpr SpectralWindow kWindows[] = {SpectralWindow::kRectangular,    SpectralWindow::kHann,
                                       SpectralWindow::kHamming,        SpectralWindow::kBlackman,
                                       SpectralWindow::kBlackmanHarris, SpectralWindow::kFlatTop};

std::vector<double> Stamps(std::size_t n, double dt) {
  std::vector<double> t(n);
  for (std::size_t i = 0; i < n; ++i) t[i] = dt * static_cast<double>(i);
  return t;
}

std::vector<double> Noise(std::size_t n, Rng& rng) {
  std::vector<double> x(n);
  for (double& v : x) v = rng.Normal();
  return x;
}

TEST(Window, GainAndNoiseBandwidthAreThoseOfTheValues) {
  for (const SpectralWindow window : kWindows) {
    for (std::size_t n : {64u, 65u, 501u}) {
      double sum = 0.0, square = 0.0;
      for (const double w : WindowValues(window, n)) sum += w, square += w * w;
      EXPECT_NEAR(sum / static_cast<double>(n), CoherentGain(window), kRoundOff) << Name(window);
      EXPECT_NEAR(static_cast<double>(n) * square / (sum * sum), NoiseBandwidth(window), 1e-11);
    }
  }
}

TEST(Window, NoiseBandwidthsAreThePublishedOnes) {
  // [Harris 1978], table 1, to its two decimals; flat top: 3.77.
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kRectangular), 1.00, 0.005);
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kHann), 1.50, 0.005);
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kHamming), 1.36, 0.005);
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kBlackman), 1.73, 0.005);
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kBlackmanHarris), 2.00, 0.005);
  EXPECT_NEAR(NoiseBandwidth(SpectralWindow::kFlatTop), 3.77, 0.005);
}

TEST(Window, ResponseIsTheTransformBetweenTheBins) {
  constexpr std::size_t kN = 4096;
  for (const SpectralWindow window : kWindows) {
    const std::vector<double> w = WindowValues(window, kN);
    for (const double bins : {0.0, 0.25, 0.5, 0.8, 1.5, 2.3}) {
      double re = 0.0, im = 0.0;
      for (std::size_t i = 0; i < kN; ++i) {
        const double a = kTau * bins * static_cast<double>(i) / kN;
        re += w[i] * std::cos(a);
        im += w[i] * std::sin(a);
      }
      // The closed form is that of n to infinity; the difference falls with 1 / n^2.
      EXPECT_NEAR(std::hypot(re, im) / (kN * CoherentGain(window)), WindowResponse(window, bins),
                  1e-5);
    }
  }
}

TEST(Spectrum, PeaksBetweenTheBinsUnderEveryWindow) {
  const double dt = 0.005;
  for (const SpectralWindow window : kWindows) {
    for (std::size_t n : {1200u, 1201u}) {
      const double bin = 1.0 / (static_cast<double>(n) * dt);
      for (const double part : {0.0, 0.3, 0.5, 0.9}) {
        std::vector<double> x(n);
        for (std::size_t i = 0; i < n; ++i) {
          x[i] = 0.4 * std::cos(kTau * (150.0 + part) * bin * dt * static_cast<double>(i) + 1.0);
        }
        const Spectrum s = AmplitudeSpectrum(x, dt, "m", {window, Detrend::kNone});
        const std::vector<Peak> peaks = FindPeaks(s);
        ASSERT_FALSE(peaks.empty()) << Name(window);
        // The mirror image, 300 bins away, leaks most where the window ends in a step: all of it
        // without a window, 8% of it under Hamming's.
        const double leak = window == SpectralWindow::kRectangular ? 5e-3
                            : window == SpectralWindow::kHamming   ? 0.08 * 5e-3
                                                                   : 1e-4;
        EXPECT_NEAR(peaks[0].frequency / bin, 150.0 + part, leak) << Name(window);
        EXPECT_NEAR(peaks[0].amplitude, 0.4, leak) << Name(window);
      }
    }
  }
}

TEST(Welch, TheIntegralIsTheVariance) {
  Rng rng(2);
  for (std::size_t n : {256u, 257u}) {  // even and odd
    const std::vector<double> x = Noise(n, rng), t = Stamps(n, 0.01);
    const CrossSpectrum s =
        WelchCrossSpectrum(t, x, x, "m", {SpectralWindow::kRectangular, Detrend::kNone, n, 0.0});
    ASSERT_EQ(s.segments, 1u);
    double integral = 0.0, mean_square = 0.0;
    for (const double v : s.xx) integral += v * s.resolution;
    for (const double v : x) mean_square += v * v / static_cast<double>(n);
    EXPECT_NEAR(integral, mean_square, kRoundOff);  // Parseval
  }
}

TEST(Welch, WhiteNoiseStandsAtItsLevelUnderEveryWindow) {
  Rng rng(4);
  constexpr std::size_t kN = 40000;
  constexpr double kDt = 0.002;
  const std::vector<double> x = Noise(kN, rng), t = Stamps(kN, kDt);
  for (const SpectralWindow window : kWindows) {
    const CrossSpectrum s = WelchCrossSpectrum(t, x, x, "m", {window, Detrend::kMean, 256, 0.5});
    std::vector<double> inner(s.xx.begin() + 8, s.xx.end() - 8);
    // Variance 1 over a band of 250 Hz. Mean of some 110 bins, each 1 / sqrt(150 segments).
    EXPECT_NEAR(Mean(inner) * 0.5 / kDt, 1.0, 0.03) << Name(window);
    // What the words claim: relative variance of a bin is one over the independent segments. The
    // estimate from 113 bins that the window correlates scatters by 25% at most.
    const double relative = Variance(inner) / (Mean(inner) * Mean(inner));
    EXPECT_NEAR(relative * s.effective_segments, 1.0, 0.45) << Name(window);
  }
}

TEST(Welch, ASineAndItsShiftedMultiple) {
  const std::size_t n = 1000;
  const std::vector<double> t = Stamps(n, 0.01);
  std::vector<double> x(n), y(n);
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = std::cos(kTau * 10.0 * t[i]);
    y[i] = 3.0 * std::cos(kTau * 10.0 * t[i] + 0.7);
  }
  const CrossSpectrum s =
      WelchCrossSpectrum(t, x, y, "m", {SpectralWindow::kHann, Detrend::kNone, 200, 0.5});
  ASSERT_EQ(s.segments, 9u);
  EXPECT_NEAR(s.frequency[20], 10.0, kRoundOff);
  EXPECT_NEAR(s.coherence[20], 1.0, kRoundOff);
  EXPECT_NEAR(std::arg(s.xy[20]), 0.7, 1e-10);
  EXPECT_NEAR(std::sqrt(s.yy[20] / s.xx[20]), 3.0, 1e-10);
  // A sine on a bin: its mean square over the window's noise bandwidth.
  EXPECT_NEAR(s.xx[20], 0.5 / s.noise_bandwidth, 1e-10);
  EXPECT_NE(s.convention.find("m^2/Hz"), std::string::npos);
  EXPECT_NE(s.convention.find("Hann"), std::string::npos);
}

TEST(Welch, CoherenceOfASharedPartInNoise) {
  // x = a + n1, y = a + n2 with equal variances: coherence 1/4 in every bin.
  Rng rng(6);
  constexpr std::size_t kN = 100000;
  const std::vector<double> t = Stamps(kN, 0.01), a = Noise(kN, rng);
  std::vector<double> x = Noise(kN, rng), y = Noise(kN, rng);
  const std::vector<double> n1 = x, n2 = y;
  for (std::size_t i = 0; i < kN; ++i) x[i] += a[i], y[i] += a[i];
  const DensityOptions options = {SpectralWindow::kHann, Detrend::kMean, 128, 0.5};
  const CrossSpectrum shared = WelchCrossSpectrum(t, x, y, "m", options);
  EXPECT_NEAR(Mean(shared.coherence), 0.25, 0.01);
  const CrossSpectrum unrelated = WelchCrossSpectrum(t, n1, n2, "m", options);
  double above = 0.0;
  for (const double c : unrelated.coherence) above += c > unrelated.no_coherence ? 1.0 : 0.0;
  // 5% of 65 bins that the window correlates: at most one in five by chance.
  EXPECT_LT(above / static_cast<double>(unrelated.coherence.size()), 0.2);
}

TEST(Welch, SegmentsStayOnTheirSideOfAGap) {
  std::vector<double> t = Stamps(400, 0.01), x(400), y(400);
  for (std::size_t i = 0; i < 400; ++i) {
    if (i >= 150) t[i] += 0.5;
    x[i] = std::cos(kTau * 12.5 * t[i]);
    y[i] = i == 149 || i == 150 ? 1e6 : x[i];  // only a segment across the gap would hold both
  }
  const CrossSpectrum s =
      WelchCrossSpectrum(t, x, x, "m", {SpectralWindow::kHann, Detrend::kNone, 80, 0.5});
  EXPECT_EQ(s.segments, 2u + 5u);
  EXPECT_NEAR(s.xx[10], 0.5 / s.noise_bandwidth, 1e-9);
}

TEST(Welch, TooShortIsRefused) {
  const std::vector<double> t = Stamps(6, 0.1), x(6, 1.0);
  EXPECT_THROW(WelchCrossSpectrum(t, x, x, "m"), Error);
}

TEST(Frac, InClosedForm) {
  using C = std::complex<double>;
  const std::vector<C> a = {C(1, 0), C(0, 1), C(2, -1)};
  std::vector<C> b = a;
  for (C& v : b) v *= C(0.3, -2.0);
  EXPECT_NEAR(FrequencyResponseAssurance(a, b), 1.0, kRoundOff);
  EXPECT_NEAR(FrequencyResponseAssurance(std::vector<C>{1, 0}, std::vector<C>{0, 1}), 0.0,
              kRoundOff);
  EXPECT_NEAR(FrequencyResponseAssurance(std::vector<C>{1, 0},
                                         std::vector<C>{std::cos(0.3), std::sin(0.3)}),
              std::cos(0.3) * std::cos(0.3), kRoundOff);
}

TEST(FourierAmplitude, StrobedSignalsShareAPhase) {
  for (const double delay : {0.0, 0.0013, 0.004}) {
    std::vector<double> t = Stamps(1000, 0.005), x;
    for (double& v : t) v += delay;
    for (const double v : t) x.push_back(0.3 * std::cos(kTau * 7.0 * v + 0.5) + 2.0 - 0.1 * v);
    const std::complex<double> c = FourierAmplitude(t, x, 7.0, 0.0);
    // The mirror image and what the line takes leak with the cube of 35 periods.
    EXPECT_NEAR(std::abs(c), 0.3, 1e-3);
    EXPECT_NEAR(std::arg(c), 0.5, 3e-3);
  }
}

TEST(LombScargle, OnEvenStampsIsTheSpectrum) {
  const std::vector<double> t = Stamps(1000, 0.005);
  std::vector<double> x;
  for (const double v : t) x.push_back(0.25 * std::cos(kTau * 8.0 * v + 0.2));
  LombOptions options;
  options.low = 8.0;
  options.high = 8.05;
  options.oversample = 1;
  const LombSpectrum s = LombScargle(t, x, {}, "m", options);
  // Whole periods: exact but for the straight line that was taken out.
  EXPECT_NEAR(s.amplitude.front(), 0.25, 1e-4);
  EXPECT_NEAR(s.power.front(), 1.0, 1e-3);
}

TEST(LombScargle, SeesThroughGapsWithoutInventingPeaks) {
  int right = 0;
  std::vector<double> z;
  constexpr int kSeeds = 25;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed);
    std::vector<double> t, x, sigma;
    for (int i = 0; i < 1000; ++i) {
      const double at = 0.005 * i + 0.001 * rng.Uniform();
      // A third is lost, half of it in one piece.
      if ((at > 1.2 && at < 2.0) || rng.Uniform() < 0.2) continue;
      t.push_back(at);
      x.push_back(0.010 * std::cos(kTau * 3.13 * at + 0.3) +
                  0.004 * std::cos(kTau * 11.71 * at + 1.0) + 5e-4 * rng.Normal());
      sigma.push_back(5e-4);
    }
    const std::vector<LombPeak> peaks = FindLombPeaks(t, x, sigma);
    if (peaks.size() != 2) continue;
    ++right;
    EXPECT_NEAR(peaks[0].amplitude, 0.010, 3e-4);
    EXPECT_NEAR(peaks[1].amplitude, 0.004, 3e-4);
    // Cramer-Rao for one sine over n even samples [Kay 1993]; gaps about the middle are kinder.
    const double n = static_cast<double>(t.size()), T = 5.0;
    const double bound = std::sqrt(6.0) * 5e-4 / (std::numbers::pi * 0.010 * T * std::sqrt(n));
    z.push_back((peaks[0].frequency - 3.13) / bound);
  }
  // False peaks: 1% a search.
  EXPECT_GE(right, kSeeds - 2);
  EXPECT_LT(Rms(z), 1.2 + 3.0 / std::sqrt(2.0 * kSeeds));
}

// A decay's flanks are no peaks and hide none: of two modes the second was lost where the first had
// fallen to a third, and amplitudes that fall as dry friction has it leave flanks of another form.
TEST(LombScargle, TellsDecaysApart) {
  for (const double decay : {0.0, 0.3, 0.8, 2.0, -0.5}) {
    for (const bool second : {false, true}) {
      Rng rng(7);
      std::vector<double> t, x;
      for (int i = 0; i < 400; ++i) {
        if (i > 150 && i < 260 && i % 4 != 0) continue;
        const double at = 0.015 * i, size = std::exp(-decay * at);
        t.push_back(at);
        x.push_back(size * std::cos(kTau * 1.3 * at) + 2e-3 * rng.Normal() +
                    (second ? 0.3 * size * std::cos(kTau * 4.1 * at + 1.0) : 0.0));
      }
      const std::vector<LombPeak> peaks = FindLombPeaks(t, x, {});
      ASSERT_EQ(peaks.size(), second ? 2u : 1u) << decay;
      EXPECT_NEAR(peaks[0].frequency, 1.3, 0.01) << decay;
      EXPECT_NEAR(peaks.back().frequency, second ? 4.1 : 1.3, 0.03) << decay;
    }
  }
  Rng rng(8);
  std::vector<double> t, x;
  for (int i = 0; i < 400; ++i) {
    if (i % 7 == 3) continue;
    t.push_back(0.015 * i);
    x.push_back(std::max(0.0, 1.0 - 0.2 * t.back()) * std::cos(kTau * 1.3 * t.back()) +
                2e-3 * rng.Normal());
  }
  EXPECT_EQ(FindLombPeaks(t, x, {}).size(), 1u);
}

TEST(LombScargle, NoiseShowsPeaksAsOftenAsItSays) {
  constexpr int kSeeds = 300;
  std::size_t found = 0;
  LombOptions options;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(1000 + seed);
    std::vector<double> t, x;
    for (int i = 0; i < 120; ++i) {
      if (i > 40 && i < 60) continue;
      t.push_back(0.01 * i);
      x.push_back(rng.Normal());
    }
    found += FindLombPeaks(t, x, {}, options, 1).size();
  }
  // 1% by design, and oversampling adds some: no more than 4% (95% interval of the count: <= 18).
  EXPECT_LE(found, 18u);
}

// Oscillators (frequency [Hz], damping ratio) that white noise drives, sampled: each by the poles
// of its exact discretisation, to unit variance; and a tenth of white noise.
std::vector<double> Driven(const std::vector<std::pair<double, double>>& modes, std::size_t n,
                           double dt, Rng& rng) {
  std::vector<double> sum(n, 0.0);
  for (const auto& [frequency, ratio] : modes) {
    const double w = kTau * frequency, decay = std::exp(-ratio * w * dt);
    const double a1 = 2.0 * decay * std::cos(w * std::sqrt(1.0 - ratio * ratio) * dt);
    const double a2 = -decay * decay;
    std::vector<double> x(n, 0.0);
    double before = 0.0, at = 0.0;
    for (double& v : x) {
      v = a1 * at + a2 * before + rng.Normal();
      before = at;
      at = v;
    }
    const double scale = 1.0 / std::sqrt(Variance(x));
    for (std::size_t i = 0; i < n; ++i) sum[i] += scale * x[i];
  }
  for (double& v : sum) v += (modes.empty() ? 1.0 : 0.1) * rng.Normal();
  return sum;
}

// Frequencies of the peaks of a record in 32 segments.
std::vector<Peak> PeaksOf(const std::vector<double>& x, double dt) {
  const CrossSpectrum density =
      WelchCrossSpectrum(Stamps(x.size(), dt), x, x, "m",
                         {SpectralWindow::kHann, Detrend::kLine, x.size() * 2 / 33, 0.5});
  return FindDensityPeaks(density.xx, density);
}

TEST(DensityPeaks, NoiseHasNoneButByTheChanceThatIsSaid) {
  Rng rng(3);
  constexpr int kRecords = 200;
  int with = 0;
  for (int r = 0; r < kRecords; ++r) with += PeaksOf(Noise(3000, rng), 0.02).empty() ? 0 : 1;
  // One in twenty at most, and what 200 draws leave of that.
  EXPECT_LE(BinomialInterval(static_cast<std::size_t>(with), kRecords).first, 0.05);
}

// One long transform makes several peaks of one resonance: its speckle.
TEST(DensityPeaks, AResonanceIsOneWhateverItsDamping) {
  Rng rng(4);
  constexpr double kStep = 0.02;
  const std::vector<std::vector<std::pair<double, double>>> cases = {
      {{2.0, 0.01}}, {{1.9, 0.28}}, {{1.0, 0.005}, {4.0, 0.02}, {9.0, 0.05}}};
  for (const auto& modes : cases) {
    constexpr int kRecords = 60;
    int right = 0;
    for (int r = 0; r < kRecords; ++r) {
      const std::vector<double> x = Driven(modes, 8000, kStep, rng);
      std::vector<Peak> peaks = PeaksOf(x, kStep);
      std::sort(peaks.begin(), peaks.end(),
                [](const Peak& a, const Peak& b) { return a.frequency < b.frequency; });
      bool good = peaks.size() == modes.size();
      for (std::size_t k = 0; good && k < modes.size(); ++k) {
        const double bin = 33.0 / (2.0 * 8000 * kStep);
        // Within half the width at half power, or a bin.
        const double wide = std::max(bin, modes[k].first * modes[k].second);
        good = std::abs(peaks[k].frequency - modes[k].first) < wide;
      }
      right += good ? 1 : 0;
    }
    EXPECT_GE(BinomialInterval(static_cast<std::size_t>(right), kRecords).second, 0.95)
        << modes.size() << " from " << modes[0].first << " Hz: " << right;
  }
}

TEST(DensityPeaks, AmplitudesAreTheRootMeanSquareAround) {
  Rng rng(5);
  const auto x = Driven({{2.0, 0.01}}, 20000, 0.02, rng);
  const std::vector<Peak> peaks = PeaksOf(x, 0.02);
  ASSERT_EQ(peaks.size(), 1u);
  EXPECT_NEAR(peaks[0].amplitude, 1.0, 0.05);
}
}  // namespace
}  // namespace unfurl::correlate::spectral_density_test
