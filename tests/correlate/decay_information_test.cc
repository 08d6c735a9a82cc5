#include "correlate/modes/decay_information.h"

#include <gtest/gtest.h>

#include <cmath>

#include "correlate/modes/modal_id.h"
#include "tests/correlate/free_decay.h"

namespace unfurl::correlate::decay_information_test {
namespace {

TEST(DecayInformation, OfASineThatDoesNotDecay) {
  EXPECT_NEAR(InformationShare(0.0, 0.5, 2.0), 1.0 / 64.0, 1e-14);  // the cube [Kay 1993]
  EXPECT_NEAR(InformationShare(1e-9, 100.0, 200.0), 0.125, 1e-6);
  EXPECT_EQ(InformationShare(0.3, 7.0, 7.0), 1.0);
}

// Whole decays: of t^2 exp(-2 a t), projected, up to 2 a t = x, with x to infinity:
// 1 - e^-x x^2 / (1 - e^-x) - ..., from the moments of the truncated exponential.
TEST(DecayInformation, OfADecayThatEnds) {
  for (const double x : {0.999, 1.001, 3.0, 10.0, 30.0}) {
    const double end = std::exp(-x), mass = 1.0 - end;
    const double mean = 1.0 - x * end / mass;
    const double square = 2.0 - (x * x + 2.0 * x) * end / mass;
    // 2 a = 1; the whole is 2000 long: mass 1, variance 1.
    EXPECT_NEAR(InformationShare(0.5, x, 2000.0), mass * (square - mean * mean), 1e-12) << x;
  }
  // Growing ones hold it in their end.
  EXPECT_LT(InformationShare(-0.5, 5.0, 10.0), 0.01);
}

// Against the Cramer-Rao bound of the whole Fisher matrix, by differences: of one mode with a
// trend, the ratio of the bounds' squares; the trend takes a little of both.
TEST(DecayInformation, IsTheRatioOfCramerRaoBounds) {
  constexpr double kStep = 0.05, kWhole = 60.0;  // s
  for (const double damping : {0.0, 0.003, 0.02}) {
    for (const double window : {15.0, 40.0}) {
      const auto bound = [&](double until) {
        PlantedDecay planted;
        planted.modes = {{1.3, damping, {{1.0, 0.4}}}};
        planted.sigma = 0.01;
        planted.t.resize(1);
        for (int i = 0; kStep * i < until; ++i) planted.t[0].push_back(kStep * i);
        return planted.Bound();
      };
      const Eigen::VectorXd whole = bound(kWhole), part = bound(window);
      const double a = 2.0 * M_PI * 1.3 * damping;
      const double share = InformationShare(a, window, kWhole);
      constexpr double kTrend = 0.03;  // what sines of 20 periods have in common with a line [-]
      EXPECT_NEAR(share / std::pow(whole(0) / part(0), 2), 1.0, kTrend) << damping << " " << window;
    }
  }
}

// Modes of a record that is longer than what is fitted: those of its first part, with the errors of
// that part, and how much more the rest holds of each: little of what decays, much of what does
// not.
TEST(DecayInformation, OfModesOfALongRecord) {
  PlantedDecay planted;
  planted.modes = {{0.7, 0.0005, {{1.0, 0.0}, {0.5, 0.2}}}, {2.1, 0.01, {{0.6, 0.3}, {-0.9, 0.0}}}};
  planted.sigma = 0.02;
  planted.t.resize(2);
  for (int i = 0; i < 6000; ++i) {
    for (std::size_t j = 0; j < 2; ++j) {
      planted.t[j].push_back(0.05 * i + 0.01 * static_cast<double>(j));
    }
  }
  Rng rng(17);
  const auto signals = planted.Draw(rng);
  ModalOptions options;
  options.most_samples = 2000;  // 100 of 300 s
  const ModalFit part = IdentifyModes(signals, options);
  ASSERT_EQ(part.decay.modes.size(), 2U);
  const std::vector<std::complex<double>> poles = {part.decay.modes[0].pole,
                                                   part.decay.modes[1].pole};
  const DecayFit whole = FitDecay(signals, poles);
  ASSERT_TRUE(whole.Usable());
  EXPECT_TRUE(part.cut);
  EXPECT_EQ(part.decay.samples, 4000U);
  EXPECT_NEAR(part.until, 99.96, 1e-9);
  for (std::size_t k = 0; k < 2; ++k) {
    const Mode &a = whole.modes[k], &b = part.decay.modes[k];
    EXPECT_EQ(a.information, 1.0);
    const double found = std::pow(a.frequency_sigma / b.frequency_sigma, 2);
    // Both sigmas are estimates: the damping that they rest on is known to some per cent.
    EXPECT_NEAR(b.information / found, 1.0, 0.15) << k;
    EXPECT_NEAR(b.frequency, planted.modes[k].frequency, 4.0 * b.frequency_sigma);
  }
  EXPECT_LT(part.decay.modes[0].information, 0.3);
  EXPECT_GT(part.decay.modes[1].information, 0.999);
}

}  // namespace
}  // namespace unfurl::correlate::decay_information_test
