// Whether the modes of a free decay are those of all of it: on damped sines in closed form, and on
// oscillators that are not linear, integrated here.
#include "correlate/modes/decay_judges.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "correlate/modes/identify.h"
#include "tests/correlate/free_decay.h"

namespace unfurl::correlate::decay_judges_test {
namespace {

using ::testing::HasSubstr;

constexpr double kRate = 20.0, kTurn = 2.0 * std::numbers::pi;  // [Hz]; 1 Hz, as all here

// x'' = -force(x, x'), from 1 at rest, by Runge and Kutta's method with forty steps a sample.
std::vector<DecaySignal> Swing(const std::function<double(double, double)>& force, int samples,
                               double noise, std::uint64_t seed) {
  constexpr int kSteps = 40;
  const double h = 1.0 / (kRate * kSteps);
  Rng rng(seed);
  DecaySignal out{"x", {}, {}, {}};
  double x = 1.0, v = 0.0;
  for (int i = 0; i < samples; ++i) {
    out.t.push_back(i / kRate);
    out.value.push_back(x + noise * rng.Normal());
    for (int s = 0; s < kSteps; ++s) {
      const double a1 = -force(x, v), v2 = v + 0.5 * h * a1;
      const double a2 = -force(x + 0.5 * h * v, v2), v3 = v + 0.5 * h * a2;
      const double a3 = -force(x + 0.5 * h * v2, v3), v4 = v + h * a3;
      const double a4 = -force(x + h * v3, v4);
      x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
      v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
  }
  return {out};
}

PlantedDecay Planted(std::uint64_t seed) {
  Rng rng(seed);
  PlantedDecay out;
  out.modes.resize(1 + seed % 3);
  double f = 0.4;
  for (PlantedMode& m : out.modes) {
    f *= 1.15 + rng.Uniform();
    m = {f, 0.005 + 0.03 * rng.Uniform(), {}};
    for (int j = 0; j < 2; ++j) m.amplitude.emplace_back(rng.Normal(), rng.Normal());
  }
  for (int j = 0; j < 2; ++j) {
    out.t.emplace_back();
    for (int i = 0; i < 1200; ++i) out.t.back().push_back(i / kRate);
  }
  out.sigma = 0.01;
  return out;
}

TEST(DecayJudges, ModesOfALinearStructureStand) {
  int doubted = 0;
  constexpr int kRuns = 60;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Rng rng = Rng(seed).Stream("noise");
    const Identification found = Identify(Planted(seed).Draw(rng), Excitation::kByTheData);
    ASSERT_TRUE(found.fit.decay.Usable()) << seed;
    doubted += found.doubtful ? 1 : 0;
  }
  EXPECT_LE(doubted, 3);  // a chance of 1% each: once in a thousand times there are more
}

// A stiffness that grows by a tenth at the first amplitude: damped sines side by side describe it,
// and leave nothing but noise.
TEST(DecayJudges, AStiffnessThatIsNotLinearIsDoubted) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto record = Swing(
        [](double x, double v) {
          return kTurn * kTurn * x * (1.0 + 0.1 * x * x) + 2.0 * 0.01 * kTurn * v;
        },
        1600, 0.003, seed);
    const Identification found = Identify(record, Excitation::kByTheData);
    EXPECT_TRUE(found.doubtful) << seed << ": " << found.fit.decay.modes.size() << " modes";
  }
}

TEST(DecayJudges, FrictionIsDoubted) {
  int several = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto record = Swing(
        [](double x, double v) {
          return kTurn * kTurn * (x + 0.01 * std::tanh(v / (1e-3 * kTurn))) +
                 2.0 * 0.01 * kTurn * v;
        },
        400, 0.003, seed);
    const Identification found = Identify(record, Excitation::kByTheData);
    // One mode, whose damping is as uncertain as it varies, is no wrong one.
    if (found.fit.decay.modes.size() == 1) continue;
    ++several;
    EXPECT_THAT(found.why, HasSubstr("friction")) << seed;
  }
  EXPECT_GE(several, 3);
}

TEST(DecayJudges, CloseModesOfTheirOwnShapesStand) {
  int doubted = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Rng rng(seed);
    PlantedDecay pair = Planted(2);
    pair.modes = {{1.0, 0.012, {{1.0, 0.0}, {0.8, 0.0}}}, {1.02, 0.012, {{0.7, 0.0}, {-0.9, 0.0}}}};
    const Identification found = Identify(pair.Draw(rng), Excitation::kByTheData);
    ASSERT_EQ(found.fit.decay.modes.size(), 2u) << seed;
    doubted += found.doubtful ? 1 : 0;
  }
  EXPECT_LE(doubted, 2);
}

TEST(DecayJudges, WhatDoesNotFadeIsNoMode) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Rng rng = Rng(seed).Stream("noise");
    auto record = Planted(seed).Draw(rng);
    for (DecaySignal& s : record) {
      for (std::size_t i = 0; i < s.t.size(); ++i) {
        s.value[i] += 0.1 * std::sin(kTurn * 7.3 * s.t[i] + 0.1);
      }
    }
    const Identification found = Identify(record, Excitation::kByTheData);
    ASSERT_TRUE(found.fit.decay.Usable()) << seed;
    EXPECT_TRUE(found.doubtful);
    EXPECT_THAT(found.why, HasSubstr("7.3000 Hz does not fade"));
  }
}

// The difference is in the error: of the frequency that a linear structure of the same small
// swings would have.
TEST(DecayJudges, ErrorsAreWidenedByTheDifference) {
  const auto record = Swing(
      [](double x, double v) {
        return kTurn * kTurn * x * (1.0 + 0.1 * x * x) + 2.0 * 0.01 * kTurn * v;
      },
      1600, 0.003, 7);
  DecayOptions options;
  const std::complex<double> pole(-0.01 * kTurn, kTurn);
  DecayFit fit = FitDecay(record, std::vector{pole}, options);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  const double sigma = fit.modes[0].frequency_sigma, off = fit.modes[0].frequency - 1.0;
  EXPECT_GT(off, 5.0 * sigma);
  EXPECT_FALSE(WidenByLaterPart(record, options, 0.01, &fit).empty());
  EXPECT_LT(off, 3.0 * fit.modes[0].frequency_sigma);
  EXPECT_NEAR(std::sqrt(fit.covariance(0, 0)), fit.modes[0].frequency_sigma, 1e-12);
}

}  // namespace
}  // namespace unfurl::correlate::decay_judges_test
