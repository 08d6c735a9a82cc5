// The promise of the precise estimator over its whole range, by Monte Carlo.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/statistics.h"
#include "measure/spot_bound.h"
#include "tests/measure/spot_bench.h"

namespace unfurl::measure::spot_slow_test {
namespace {

struct Cell {
  double sigma, snr;
};

class MaximumLikelihood : public ::testing::TestWithParam<Cell> {};

TEST_P(MaximumLikelihood, IsEfficientUnbiasedAndHonest) {
  constexpr int kRepeats = 4000;             // a scatter to 1.1%
  constexpr double kEfficiency = 1.1;        // of scatter over the bound
  constexpr double kBias = 0.02;             // at any phase, beyond four standard errors [px]
  constexpr double kHonest = 0.045 + 0.015;  // four standard errors, and the bound's own spread
  constexpr double kLost = 0.02;             // of the dimmest: fits that say that they failed
  constexpr int kPhases = 10;
  const auto [sigma, snr] = GetParam();
  SpotBench bench;
  const double g = bench.gain();
  const double dark = std::pow(bench.sensor().read_noise, 2) + g * g / 12.0;
  const double share = std::erf(0.5 / sigma * M_SQRT1_2);  // of the light, in the middle pixel
  const double peak = 0.5 * (snr * snr + snr * std::sqrt(snr * snr + 4.0 * dark));
  const double electrons = peak / share;
  ASSERT_LT(peak, 0.95 * bench.sensor().full_well);
  const PixelNoise noise{.electrons_per_count = g, .dark_variance = 1.01 * dark / (g * g)};
  std::vector<double> error, stated, by_phase[kPhases];
  double bound = 0.0;
  int lost = 0;
  Rng rng(11);
  for (int i = 0; i < kRepeats; ++i) {
    const int phase = i % kPhases;
    const double centre = 400 + 41 * (i % 31) + (phase + rng.Uniform()) / kPhases;
    bench.Clear();
    bench.AddGaussian(centre, sigma, electrons);
    const Spot spot = bench.Find(rng);
    if (!Usable(spot)) {
      ++lost;
      continue;
    }
    error.push_back(spot.u_px - centre);
    by_phase[phase].push_back(error.back());
    stated.push_back(spot.s_px);
    bound += std::pow(CentreBound(centre, sigma, electrons / g, noise), 2);
  }
  bound = std::sqrt(bound / static_cast<double>(error.size()));
  EXPECT_LE(Rms(error), kEfficiency * bound);
  EXPECT_NEAR(Rms(error) / Rms(stated), 1.0, kHonest);
  EXPECT_LE(lost, snr > 15.0 ? 0 : static_cast<int>(kLost * kRepeats));
  for (const std::vector<double>& errors : by_phase) {
    const double standard_error = std::sqrt(Variance(errors) / static_cast<double>(errors.size()));
    EXPECT_LT(std::abs(Mean(errors)), kBias + 4.0 * standard_error);
  }
  RecordProperty("scatter_over_bound", std::to_string(Rms(error) / bound));
}

std::vector<Cell> Cells() {
  std::vector<Cell> cells;
  for (const double sigma : {0.7, 1.0, 1.5, 2.5, 4.0, 7.0, 10.0}) {
    for (const double snr : {10.0, 30.0, 100.0, 220.0}) cells.push_back({sigma, snr});
  }
  return cells;
}
INSTANTIATE_TEST_SUITE_P(WidthAndBrightness, MaximumLikelihood, ::testing::ValuesIn(Cells()));

}  // namespace
}  // namespace unfurl::measure::spot_slow_test
