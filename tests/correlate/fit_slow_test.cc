#include <gtest/gtest.h>

#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate {
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

}  // namespace
}  // namespace unfurl::correlate
