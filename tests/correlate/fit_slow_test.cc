#include <gtest/gtest.h>

#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/identify_cases.h"
#include "tests/correlate/instruments.h"
#include "tests/correlate/pendulum_repeats.h"

namespace unfurl::correlate::fit_slow_test {
namespace {

constexpr int kTrials = 1000;

TEST(FitSlow, CoversWithWhiteNoise) { ExpectHonest(Repeat(SparseTrial(), kTrials, 10000)); }

TEST(FitSlow, CoversWithACalibrationErrorCommonToAllSamples) {
  Trial trial = SparseTrial();
  trial.shared_rank = 3;
  trial.shared_size = 1e-3;
  ExpectHonest(Repeat(trial, kTrials, 20000));
}

TEST(FitSlow, CoversWithCorrelatedNoise) {
  Trial trial = SparseTrial();
  trial.rho = 0.9;
  ExpectHonest(Repeat(trial, kTrials, 30000), 0.93, 0.97);
}

TEST(FitSlow, CoversWithNoiseThatOutlastsTheRecordAlmost) {
  Trial trial = SparseTrial();
  trial.rho = 0.98;  // 50 samples of 124
  ExpectHonest(Repeat(trial, kTrials, 40000), 0.93, 0.97);
}

TEST(FitSlow, CoversWithAnAccelerometerAlone) {
  ExpectHonest(RepeatAccelerometer(kTrials, 60000, true), 0.93, 0.97);
}

TEST(FitSlow, CoversWithAnAccelerometerOfWhichNoSigmaIsStated) {
  ExpectHonest(RepeatAccelerometer(kTrials, 70000, false), 0.93, 0.97);
}

TEST(FitSlow, HiddenSetsAreNamed) {
  constexpr int kSeeds = 200;
  constexpr double kFalseAlarms = 0.01;
  int false_alarms = 0, clear = 0;
  for (const IdentifyCase& which : IdentifyCases()) {
    const IdentifyCount count = CountIdentified(which, kSeeds, 50000);
    fmt::print("{}: {} of {} named, {} of {} false alarms\n", which.name, count.named, count.should,
               count.false_alarms, count.clear);
    EXPECT_EQ(count.named, count.should) << which.name << ": " << count.first_miss;
    false_alarms += count.false_alarms;
    clear += count.clear;
  }
  EXPECT_LE(false_alarms, kFalseAlarms * clear);
}

TEST(FitSlow, SeveralStartsFindTheGlobalMinimumOfThePendulum) {
  constexpr int kPendulums = 1000;  // issue
  constexpr double kFound = 0.99;
  const PendulumCount count = RepeatPendulum(kPendulums, 100000);
  const auto [low, high] =
      BinomialInterval(static_cast<std::size_t>(count.found), kPendulums, 0.95);
  fmt::print(
      "{} of {} global (95% interval {:.4f} to {:.4f}), {:.0f} evaluations at most; "
      "truth covered {} {} {} {}\n{}",
      count.found, kPendulums, low, high, count.most_evaluations, count.covered[0],
      count.covered[1], count.covered[2], count.covered[3], count.misses);
  EXPECT_GE(count.found, kFound * kPendulums);
  for (int covered : count.covered) {
    EXPECT_GE(covered, 0.93 * kPendulums);
    EXPECT_LE(covered, 0.97 * kPendulums);
  }
}

}  // namespace
}  // namespace unfurl::correlate::fit_slow_test
