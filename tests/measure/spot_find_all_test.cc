#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "measure/normal_pack.h"
#include "measure/spot_painter.h"
#include "measure/spot_peaks.h"
#include "tests/measure/spot_bench.h"

namespace unfurl::measure::spot_find_all_test {
namespace {

TEST(NormalPack, IsTheNormalDistribution) {
  constexpr double kRelative = 2e-9;
  for (double z = -36.0; z < 36.0; z += 0.0137) {
    Pack pdf, cdf;
    Normal(Broadcast(z), &pdf, &cdf);
    const double exact = 0.5 * std::erfc(-z * M_SQRT1_2);
    EXPECT_NEAR(cdf[3] / exact, 1.0, kRelative) << z;
    EXPECT_NEAR(pdf[5] / (std::exp(-0.5 * z * z) / std::sqrt(2.0 * M_PI)), 1.0, 1e-11) << z;
  }
  Pack pdf, cdf;
  Normal(Broadcast(-1e6), &pdf, &cdf);
  EXPECT_EQ(pdf[0], pdf[0]);
  EXPECT_LT(cdf[0], 1e-300);
}

TEST(FindPeaks, HillsValleysAndFeet) {
  // Variance 1, no shot noise: threshold 6, ground 3, hills part at 6.
  const PeakRule rule{.threshold = 6.0F, .variance = 1.0F, .gain = 1e12F};
  std::vector<SpotPeak> peaks;
  FindPeaks(std::vector<float>(200, 2.0F), rule, &peaks);
  EXPECT_TRUE(peaks.empty());
  std::vector<float> m(200, 0.0F);
  const auto hill = [&](int at, float height) {
    for (int k = -8; k <= 8; ++k) {
      const std::size_t j = static_cast<std::size_t>(at + k);
      m[j] = std::max(m[j], height * (1.0F - std::abs(static_cast<float>(k)) / 8.0F));
    }
  };
  hill(50, 100.0F);
  hill(150, 40.0F);
  FindPeaks(m, rule, &peaks);
  ASSERT_EQ(peaks.size(), 2U);
  EXPECT_EQ(peaks[0].summit, 50);
  EXPECT_EQ(peaks[1].summit, 150);
  EXPECT_NEAR(peaks[0].low, 43, 1);
  EXPECT_NEAR(peaks[0].high, 57, 1);
  EXPECT_FALSE(peaks[0].touches_next);
  // They meet at 37.5: far below both. With the valley filled, they are one.
  hill(60, 60.0F);
  FindPeaks(m, rule, &peaks);
  ASSERT_EQ(peaks.size(), 3U);
  EXPECT_TRUE(peaks[0].touches_next);
  EXPECT_EQ(peaks[0].high, peaks[1].low);
  EXPECT_FALSE(peaks[1].touches_next);
  for (std::size_t k = 50; k < 60; ++k) m[k] = std::max(m[k], 56.0F);
  FindPeaks(m, rule, &peaks);
  EXPECT_EQ(peaks.size(), 2U);
}

// One value of light, or two far apart, anywhere in lines of any length: the search looks at many
// values at once.
TEST(FindPeaks, NoPlaceIsMissed) {
  const PeakRule rule{.threshold = 6.0F, .variance = 1.0F, .gain = 1e12F};
  std::vector<SpotPeak> peaks;
  for (const int n : {64, 131, 200}) {
    for (int at = 0; at < n; ++at) {
      std::vector<float> m(static_cast<std::size_t>(n), 0.0F);
      m[static_cast<std::size_t>(at)] = 50.0F;
      FindPeaks(m, rule, &peaks);
      ASSERT_EQ(peaks.size(), 1U) << at;
      EXPECT_EQ(peaks[0].summit, at);
      EXPECT_EQ(peaks[0].height, 50.0F);
      EXPECT_EQ(peaks[0].low, at);  // alone above the ground
      EXPECT_EQ(peaks[0].high, at);
      const int other = (at + n / 2) % n;
      m[static_cast<std::size_t>(other)] = 30.0F;
      FindPeaks(m, rule, &peaks);
      ASSERT_EQ(peaks.size(), 2U) << at;
      EXPECT_EQ(peaks[at < other ? 1 : 0].summit, other);
      EXPECT_FALSE(peaks[0].touches_next);
    }
  }
}

// A hill's foot is a twentieth of its summit, or the ground (half the threshold) where that is
// higher.
TEST(FindPeaks, FeetByHeight) {
  const PeakRule rule{.threshold = 6.0F, .variance = 1.0F, .gain = 1e12F};
  std::vector<SpotPeak> peaks;
  for (const float height : {20.0F, 400.0F}) {
    std::vector<float> m(101, 0.0F);
    for (int k = 0; k <= 100; ++k) {
      m[static_cast<std::size_t>(k)] =
          height * std::exp(-0.02F * static_cast<float>((k - 50) * (k - 50)));
    }
    FindPeaks(m, rule, &peaks);
    ASSERT_EQ(peaks.size(), 1U);
    const double foot = std::max(0.05 * height, 3.0);
    EXPECT_NEAR(peaks[0].foot, foot / height, 1e-6);
    const double half = std::sqrt(std::log(height / foot) / 0.02);
    // The first value below the foot, or the last above the ground.
    const int reach = static_cast<int>(0.05 * height > 3.0 ? std::ceil(half) : std::floor(half));
    EXPECT_EQ(peaks[0].low, 50 - reach);
    EXPECT_EQ(peaks[0].high, 50 + reach);
  }
}

// Detection compares the sum over five pixels with its own noise. In a sensor without noise that is
// the rounding's, 1/12 of a count squared for each, and the background's mean.
TEST(FindAll, TheThresholdOfAQuietSensorIsThatOfItsRounding) {
  data::LineFormat format = ShippedLab().sensor.format;
  format.read_noise_counts = 0.0;
  Background background(format);
  const std::vector<std::uint16_t> dark(format.elements(), 50);
  for (int k = 0; k < 40; ++k) background.Add(dark);
  ASSERT_EQ(background.noise(), 0.0);
  std::vector<std::uint16_t> line = dark;
  for (std::size_t k = 0; k < 5; ++k) line[format.first_active() + 1000 + k] += 1;
  const double noise = std::sqrt(5.0 / 12.0 * (1.0 + background.mean_variance()));
  for (const double share : {0.98, 1.02}) {
    SpotOptions options;
    options.threshold = share * 5.0 / noise;  // five counts in all
    SpotFinder finder(format, options);
    std::vector<Spot> spots(4);
    EXPECT_EQ(finder.FindAll(line, background, spots), share < 1.0 ? 1U : 0U);
  }
}

TEST(FindAll, EveryLightOfALineHonestly) {
  // Six lights of very different size, no two touching: each within its own sigma. A whitened rms
  // of 300 repeats scatters by 4%: four of those.
  constexpr int kRepeats = 300;
  SpotBench bench;
  const struct {
    double u, sigma, electrons;
  } lights[] = {{40.3, 1.2, 60000.0},   {300.6, 3.0, 30000.0}, {330.2, 1.0, 6000.0},
                {1000.1, 6.0, 90000.0}, {1500.7, 0.8, 3000.0}, {2100.5, 1.5, 120000.0}};
  constexpr std::size_t kLights = std::size(lights);
  std::vector<double> whitened[kLights];
  Rng rng(3);
  for (int i = 0; i < kRepeats; ++i) {
    bench.Clear();
    double truth[kLights];
    for (std::size_t k = 0; k < kLights; ++k) {
      truth[k] = lights[k].u + rng.Uniform();
      bench.AddGaussian(truth[k], lights[k].sigma, lights[k].electrons);
    }
    const std::vector<Spot> spots = bench.FindAll(rng);
    ASSERT_EQ(spots.size(), kLights);
    for (std::size_t k = 0; k < kLights; ++k) {
      EXPECT_TRUE(Resolved(spots[k]));
      EXPECT_NE(spots[k].flags & kSpotSecond, 0);
      whitened[k].push_back((spots[k].u_px - truth[k]) / spots[k].s_px);
    }
  }
  for (std::size_t k = 0; k < kLights; ++k) {
    EXPECT_NEAR(Rms(whitened[k]), 1.0, 0.17) << k;
    EXPECT_NEAR(Mean(whitened[k]), 0.0, 4.0 / std::sqrt(kRepeats)) << k;
  }
}

TEST(FindAll, TouchingSpotsAreFittedTogetherAndSaySo) {
  // Apart by 4.5 to 7 of their sigmas, one twice as bright: with the neighbour's light in the fit
  // neither is pulled, and the stated sigma covers what is lost.
  constexpr int kRepeats = 300;
  SpotBench bench;
  for (const double apart : {4.5, 5.0, 7.0}) {
    std::vector<double> whitened;
    int overlap = 0;
    Rng rng(8);
    for (int i = 0; i < kRepeats; ++i) {
      const double sigma = 2.0, left = 900.0 + rng.Uniform(), right = left + apart * sigma;
      bench.Clear();
      bench.AddGaussian(left, sigma, 100000.0);
      bench.AddGaussian(right, 1.3 * sigma, 50000.0);
      const std::vector<Spot> spots = bench.FindAll(rng);
      ASSERT_EQ(spots.size(), 2U) << apart;
      ASSERT_TRUE(Resolved(spots[0]) && Resolved(spots[1]));
      overlap += (spots[0].flags & spots[1].flags & kSpotOverlap) != 0;
      whitened.push_back((spots[0].u_px - left) / spots[0].s_px);
      whitened.push_back((spots[1].u_px - right) / spots[1].s_px);
    }
    EXPECT_NEAR(Rms(whitened), 1.0, 0.15) << apart;  // 600 values know it to 3%
    EXPECT_NEAR(Mean(whitened), 0.0, 4.0 / std::sqrt(2.0 * kRepeats)) << apart;
    if (apart < 5.5) {
      EXPECT_EQ(overlap, kRepeats);
    }
  }
}

TEST(FindAll, FourInAChain) {
  SpotBench bench;
  Rng rng(4);
  bench.Clear();
  const double u[] = {700.3, 708.9, 717.2, 726.4};
  for (const double centre : u) bench.AddGaussian(centre, 2.0, 80000.0);
  const std::vector<Spot> spots = bench.FindAll(rng);
  ASSERT_EQ(spots.size(), 4U);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_TRUE(Resolved(spots[k]));
    EXPECT_FALSE(Usable(spots[k]));
    EXPECT_NEAR(spots[k].u_px, u[k], 5.0 * spots[k].s_px);
    EXPECT_LT(spots[k].s_px, 0.05);
  }
}

TEST(FindAll, TwoInOneHillHaveAnotherShape) {
  constexpr int kRepeats = 200;
  const double sigma = 1.5;
  SpotBench bench;
  for (const double apart : {0.0, 2.5, 3.0, 3.5}) {
    int flagged = 0;
    Rng rng(6);
    for (int i = 0; i < kRepeats; ++i) {
      const double left = 900.0 + rng.Uniform(), right = left + apart * sigma;
      bench.Clear();
      bench.AddGaussian(left, sigma, 90000.0);
      if (apart > 0.0) bench.AddGaussian(right, 1.2 * sigma, 60000.0);
      const std::vector<Spot> spots = bench.FindAll(rng);
      flagged += spots.size() == 1 && (spots[0].flags & kSpotShape) != 0;
    }
    EXPECT_EQ(flagged, apart > 0.0 ? kRepeats : 0) << apart;
  }
}

TEST(FindAll, OneLightThroughGlassIsNotMadeTwo) {
  // No spot of the whole volume at the trial's brightness: three in 1500 would show with 95%.
  const data::Lab lab = ShippedLab();
  const VirtualRig rig = MakeVirtualRig(lab);
  const Eigen::Matrix3Xd points = RandomPoints(lab.volume_low, lab.volume_high, 400, 3);
  SpotPainter painter(lab.sensor.blur / lab.sensor.format.pitch);
  SpotFinder finder(lab.sensor.format);
  Background background(lab.sensor.format);
  std::vector<double> pixels(2160, 0.0);
  std::vector<std::uint16_t> line(lab.sensor.format.elements());
  Rng rng(2);
  for (int i = 0; i < 200; ++i) {
    ReadOut(lab.sensor, pixels, lab.sensor.dark_level, rng, line);
    background.Add(line);
  }
  int seen = 0, doubled = 0, shape = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    for (const LensCamera& camera : rig.cameras) {
      SpotLight light;
      if (!TraceSpot(camera, points.col(i), &light)) continue;
      if (light.centre_px < 30.0 || light.centre_px > 2129.0) continue;
      std::fill(pixels.begin(), pixels.end(), 0.0);
      painter.Add(light, rig.flash_electrons, pixels);
      ReadOut(lab.sensor, pixels, lab.sensor.dark_level, rng, line);
      ++seen;
      Spot spots[8];
      doubled += finder.FindAll(line, background, spots) != 1;
      shape += (spots[0].flags & kSpotShape) != 0;
    }
  }
  ASSERT_GT(seen, 1400);
  EXPECT_EQ(doubled, 0);
  RecordProperty("misshapen", shape);
}

TEST(FindAll, NoPlaceForAllKeepsTheBrightest) {
  SpotBench bench;
  Rng rng(4);
  bench.Clear();
  bench.AddGaussian(300.0, 1.5, 20000.0);
  bench.AddGaussian(800.0, 1.5, 60000.0);
  bench.AddGaussian(1300.0, 1.5, 40000.0);
  Spot two[2];
  const auto line = bench.Record(rng);
  ASSERT_EQ(bench.finder().FindAll(line, bench.background(), two), 2U);
  EXPECT_NEAR(two[0].u_px, 800.0, 0.1);
  EXPECT_NEAR(two[1].u_px, 1300.0, 0.1);
  EXPECT_EQ(bench.finder().FindAll(line, bench.background(), {}), 0U);
}

TEST(FindAll, DimWideSpotsAreFoundAndNothingElseIs) {
  // Peak 4 times the noise, sigma 10: no pixel tells, fifteen together do.
  SpotBench bench;
  Rng rng(12);
  const double sigma = 10.0;
  const double noise = std::hypot(bench.sensor().read_noise, bench.gain() / std::sqrt(12.0));
  int found = 0;
  std::vector<double> whitened;
  for (int i = 0; i < 200; ++i) {
    bench.Clear();
    bench.AddGaussian(1000.0, sigma, 4.0 * noise * sigma * std::sqrt(2.0 * M_PI));
    const std::vector<Spot> spots = bench.FindAll(rng);
    ASSERT_LE(spots.size(), 1U);
    if (spots.size() == 1 && Usable(spots[0])) {
      ++found;
      whitened.push_back((spots[0].u_px - 1000.0) / spots[0].s_px);
    }
  }
  EXPECT_GE(found, 196);
  EXPECT_NEAR(Rms(whitened), 1.0, 0.25);
  bench.Clear();
  for (int i = 0; i < 500; ++i) EXPECT_TRUE(bench.FindAll(rng).empty());
}

TEST(FindAll, LightThatComesOnEverywhereMovesNothing) {
  // Ambient light of 10 counts at the left end and 30 at the right that the dark lines lack.
  SpotBench bench;
  Rng rng(12);
  std::vector<double> error;
  for (int i = 0; i < 100; ++i) {
    bench.Clear();
    for (std::size_t k = 0; k < 2160; ++k) {
      bench.pixels()[k] = bench.gain() * (10.0 + 20.0 * static_cast<double>(k) / 2160.0);
    }
    const double centre = 1200.0 + rng.Uniform();
    bench.AddGaussian(centre, 1.5, 9000.0);
    const std::vector<Spot> spots = bench.FindAll(rng);
    ASSERT_EQ(spots.size(), 1U);
    error.push_back((spots[0].u_px - centre) / spots[0].s_px);
  }
  EXPECT_NEAR(Rms(error), 1.0, 0.3);  // 100 values know it to 7%
  EXPECT_NEAR(Mean(error), 0.0, 0.4);
}

}  // namespace
}  // namespace unfurl::measure::spot_find_all_test
