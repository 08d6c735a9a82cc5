#include "correlate/fit/autocorrelation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "base/statistics.h"

namespace unfurl::correlate::autocorrelation_test {
namespace {

std::vector<double> Ar1(std::size_t n, double rho, Rng& rng) {
  std::vector<double> x(n);
  x[0] = rng.Normal();
  for (std::size_t i = 1; i < n; ++i) {
    x[i] = rho * x[i - 1] + std::sqrt(1.0 - rho * rho) * rng.Normal();
  }
  return x;
}

TEST(Autoregression, CorrelationOfAFirstOrderProcessIsAPower) {
  Autoregression ar;
  ar.a = {0.7};
  const std::vector<double> rho = ar.Correlation(10);
  for (int l = 0; l <= 10; ++l) {
    EXPECT_NEAR(rho[static_cast<std::size_t>(l)], std::pow(0.7, l), 1e-12);
  }
}

TEST(Autoregression, CorrelationOfASecondOrderProcessSatisfiesYuleWalker) {
  Autoregression ar;
  ar.a = {1.2, -0.6};
  const std::vector<double> rho = ar.Correlation(6);
  EXPECT_NEAR(rho[1], 1.2 / 1.6, 1e-12);  // a1 / (1 - a2)
  for (std::size_t l = 2; l <= 6; ++l) {
    EXPECT_NEAR(rho[l], 1.2 * rho[l - 1] - 0.6 * rho[l - 2], 1e-12);
  }
}

TEST(Autoregression, FindsWhiteNoiseWhite) {
  int first_order = 0;
  constexpr int kSeeds = 200;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed);
    const std::vector<double> x = Ar1(800, 0.0, rng);
    const std::vector<std::uint8_t> known(x.size(), 1);
    first_order += FitAutoregression(x, known).a.empty() ? 0 : 1;
  }
  EXPECT_LE(first_order, 8);  // BIC at n = 800: P(chi2_1 > log 800) is 1%
}

TEST(Autoregression, EffectiveCountPredictsTheScatterOfAMean) {
  for (double rho : {0.5, 0.9, -0.4}) {
    constexpr int kSeeds = 400;
    std::vector<double> means, predicted;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      Rng rng(seed + 1000);
      const std::vector<double> x = Ar1(800, rho, rng);
      const std::vector<std::uint8_t> known(x.size(), 1);
      const Autoregression ar = FitAutoregression(x, known);
      means.push_back(Mean(x));
      predicted.push_back(ar.variance / ar.EffectiveCount());
    }
    EXPECT_NEAR(Mean(predicted) / Variance(means), 1.0, 4.0 * std::sqrt(2.0 / kSeeds)) << rho;
  }
}

TEST(Autoregression, AGapEndsAStretchAndDoesNotBias) {
  std::vector<double> rho;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Rng rng(seed);
    std::vector<double> x = Ar1(1000, 0.8, rng);
    std::vector<std::uint8_t> known(x.size(), 1);
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (i % 10 < 2) known[i] = 0, x[i] = 1e3;  // what stands there must not matter
    }
    rho.push_back(FitAutoregression(x, known).Correlation(1)[1]);
  }
  EXPECT_NEAR(Mean(rho), 0.8, 0.01);
}

TEST(Whiteness, PValuesAreUniformForWhiteNoise) {
  int below = 0;
  constexpr int kSeeds = 400;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed + 50);
    const std::vector<double> x = Ar1(800, 0.0, rng);
    const std::vector<std::uint8_t> known(x.size(), 1);
    below += WhitenessPValue(x, known, 20) < 0.05 ? 1 : 0;
  }
  const auto [low, high] = BinomialInterval(static_cast<std::size_t>(below), kSeeds, 0.999);
  EXPECT_LT(low, 0.05);
  EXPECT_GT(high, 0.05);
}

TEST(Whiteness, CorrelatedNoiseIsRejected) {
  Rng rng(9);
  const std::vector<double> x = Ar1(800, 0.5, rng);
  const std::vector<std::uint8_t> known(x.size(), 1);
  EXPECT_LT(WhitenessPValue(x, known, 20), 1e-6);
}

}  // namespace
}  // namespace unfurl::correlate::autocorrelation_test
