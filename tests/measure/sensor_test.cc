#include "measure/sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::sensor_test {
namespace {

data::LabSensor Quiet() {
  data::LabSensor sensor = ShippedLab().sensor;
  sensor.shot_noise = false;
  sensor.read_noise = 0.0;
  sensor.dark_drift = 0.0;
  return sensor;
}

// Counts of the active pixels when each holds `electrons`.
std::vector<double> Counts(const data::LabSensor& sensor, double electrons, int seed) {
  const std::vector<double> active(static_cast<std::size_t>(sensor.format.active), electrons);
  std::vector<std::uint16_t> counts(sensor.format.elements());
  Rng rng(static_cast<std::uint64_t>(seed));
  ReadOut(sensor, active, sensor.dark_level, rng, counts);
  const auto first = counts.begin() + static_cast<std::ptrdiff_t>(sensor.format.first_active());
  return {first, first + sensor.format.active};
}

TEST(Sensor, WithEveryEffectOffItOnlyQuantises) {
  const data::LabSensor sensor = Quiet();
  const double g = sensor.format.electrons_per_count;
  for (const double electrons : {0.0, 100.0, 12345.0}) {
    for (double count : Counts(sensor, electrons, 1)) {
      EXPECT_EQ(count, std::round((electrons + sensor.dark_level) / g));
    }
  }
}

TEST(Sensor, PhotonTransfer) {
  // variance [count^2] = (read^2 + electrons) / g^2 + 1/12, each term by its own switch. A variance
  // of 2160 values scatters by sqrt(2 / 2160) = 3%: five of those.
  constexpr double kScatter = 0.16;
  for (const bool shot : {false, true}) {
    for (const double read : {0.0, 35.0}) {
      for (const double electrons : {8.0, 400.0, 30000.0}) {
        data::LabSensor sensor = Quiet();
        sensor.shot_noise = shot;
        sensor.read_noise = read;
        const double g = sensor.format.electrons_per_count;
        const double analog = (read * read + (shot ? electrons : 0.0)) / (g * g);
        if (analog < 0.5) continue;  // quantisation is then no noise of 1/12
        const std::vector<double> counts = Counts(sensor, electrons, 5);
        EXPECT_NEAR(Variance(counts) / (analog + 1.0 / 12.0), 1.0, kScatter);
        const double error = std::sqrt(analog / 2160.0);
        EXPECT_NEAR(Mean(counts), (electrons + sensor.dark_level) / g, 5.0 * error);
      }
    }
  }
}

TEST(Sensor, FullWellAndBits) {
  for (const int bits : {8, 10, 12}) {
    const data::LabSensor sensor = ShippedLab({"sensor.bits=" + std::to_string(bits)}).sensor;
    const std::vector<double> full = Counts(sensor, 1e6, 2);
    EXPECT_EQ(*std::max_element(full.begin(), full.end()), sensor.format.full_scale());
    EXPECT_EQ(sensor.format.full_scale(), std::pow(2.0, bits) - 1.0);
    EXPECT_NEAR(sensor.format.electrons_per_count * sensor.format.full_scale(), sensor.full_well,
                1e-9 * sensor.full_well);
  }
}

TEST(Sensor, ShieldedElementsSeeOnlyTheLevel) {
  const data::LabSensor sensor = Quiet();
  const std::vector<double> active(static_cast<std::size_t>(sensor.format.active), 20000.0);
  std::vector<std::uint16_t> counts(sensor.format.elements());
  Rng rng(1);
  ReadOut(sensor, active, sensor.dark_level, rng, counts);
  const double dark = std::round(sensor.dark_level / sensor.format.electrons_per_count);
  for (std::size_t k = 0; k < sensor.format.first_active(); ++k) EXPECT_EQ(counts[k], dark);
  EXPECT_EQ(counts.back(), dark);
}

TEST(Sensor, DarkLevelDrifts) {
  data::LabSensor sensor = Quiet();
  EXPECT_EQ(DarkLevel(sensor, 1.0, 0.3), sensor.dark_level);
  sensor.dark_drift = 150.0;
  sensor.dark_drift_period = 8.0;
  EXPECT_NEAR(DarkLevel(sensor, 2.0, 0.0), sensor.dark_level + 150.0, 1e-9);
  EXPECT_NEAR(DarkLevel(sensor, 6.0, 0.0), sensor.dark_level - 150.0, 1e-9);
}

TEST(Sensor, BloomingKeepsTheChargeAndTheSymmetry) {
  data::LabSensor sensor = ShippedLab().sensor;
  sensor.full_well = 1000.0;
  std::vector<double> pixels(41, 0.0);
  pixels[20] = 6000.0;
  pixels[19] = pixels[21] = 1500.0;
  pixels[17] = pixels[23] = 600.0;
  for (const double share : {1.0, 0.4}) {
    sensor.blooming = share;
    std::vector<double> bloomed = pixels;
    Bloom(sensor, bloomed);
    const double excess = 5000.0 + 2 * 500.0;
    EXPECT_NEAR(Mean(bloomed) * 41, Mean(pixels) * 41 - (1.0 - share) * excess, 1e-9);
    for (std::size_t k = 0; k < 41; ++k) {
      EXPECT_LE(bloomed[k], 1000.0);
      EXPECT_GE(bloomed[k], std::min(pixels[k], 1000.0));
      EXPECT_NEAR(bloomed[k], bloomed[40 - k], 1e-9);
    }
  }
  std::vector<double> dim(41, 900.0);
  Bloom(sensor, dim);
  EXPECT_EQ(dim, std::vector<double>(41, 900.0));
}

TEST(Sensor, PatternsAreWhatTheLabAsksFor) {
  data::LabSensor sensor = ShippedLab().sensor;
  EXPECT_TRUE(DrawPattern(sensor, Rng(1)).gain.empty());
  EXPECT_TRUE(DrawPattern(sensor, Rng(1)).response.empty());
  sensor.nonuniformity = 0.02;
  sensor.dark_nonuniformity = 40.0;
  sensor.odd_gain = 0.03;
  sensor.odd_offset = 200.0;
  const SensorPattern pattern = DrawPattern(sensor, Rng(1));
  // 2160 values know their sigma to 1.5%.
  EXPECT_NEAR(std::sqrt(Variance(pattern.response)) / 0.02, 1.0, 0.07);
  EXPECT_NEAR(Mean(pattern.response), 1.0, 4 * 0.02 / std::sqrt(2160.0));
  std::vector<double> odd, even;
  for (std::size_t k = 0; k < 2160; ++k) {
    const std::size_t element = k + sensor.format.first_active();
    (k % 2 == 1 ? odd : even).push_back(pattern.offset[element]);
    EXPECT_EQ(pattern.gain[element], k % 2 == 1 ? 1.03 : 1.0);
  }
  EXPECT_NEAR(Mean(odd) - Mean(even), 200.0, 4 * 40.0 * std::sqrt(2.0 / 1080.0));
  EXPECT_NEAR(std::sqrt(Variance(odd)) / 40.0, 1.0, 0.1);
}

}  // namespace
}  // namespace unfurl::measure::sensor_test
