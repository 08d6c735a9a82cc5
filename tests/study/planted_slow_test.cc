// Effects planted in trials, and what is said of them: 30 trials, or UNFURL_PLANTED_TRIALS.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>

#include "base/cpu_time.h"
#include "study/rivals.h"
#include "study/trial_effects.h"
#include "tests/study/swing.h"

namespace unfurl::study::planted_slow_test {
namespace {

int Trials() {
  const char* asked = std::getenv("UNFURL_PLANTED_TRIALS");
  return asked != nullptr ? std::atoi(asked) : 30;
}

class PlantedTest : public SwingTest {
 protected:
  static constexpr double kSigma = 1e-3;  // [rad]

  data::Study Study() const {
    Put("scene.toml", Scene(Laws{.linear = 0.02, .quadratic = 0.02, .stiffness = 0.1}));
    return StudyOf("all", "scene.toml", kSigma,
                   "[parameter.linear]\nkeys = [\"joint.hinge.damper.damping\"]\nstart = 0.02\n"
                   "bounds = [1e-9, 0.2]\n"
                   "[parameter.quadratic]\nkeys = [\"joint.hinge.quadratic_damper.damping\"]\n"
                   "start = 0.02\nbounds = [1e-9, 0.2]\n"
                   "[parameter.stiffness]\nkeys = [\"joint.hinge.spring.stiffness\"]\n"
                   "start = 0.1\nbounds = [1e-9, 2.0]\n");
  }

  // Half of the effects are in a trial, of any size from what nobody sees to what is plain.
  static Laws Draw(Rng& rng) {
    auto size = [&](double low, double high) {
      const bool there = rng.Uniform() < 0.5;
      const double x = low * std::pow(high / low, rng.Uniform());
      return there ? x : 0.0;
    };
    Laws laws;
    laws.linear = size(2e-4, 0.05);
    laws.quadratic = size(2e-4, 0.05);
    laws.stiffness = size(1e-3, 0.5);
    return laws;
  }
};

// The truth is what a record without noise says of the same study.
TEST_F(PlantedTest, WhatIsPlantedIsFoundAndWhatIsNotIsNot) {
  const int trials = Trials();
  const double start = CpuSeconds();
  int absent = 0, false_needed = 0, plain = 0, false_not_needed = 0, cannot = 0, all = 0;
  int reduced = 0, beyond = 0;
  double worst = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng(11).Stream("planted", static_cast<std::uint64_t>(trial));
    const Laws laws = Draw(rng);
    Record(laws, 1e-9 * kSigma, 1);
    const TrialEffects truth = WeighTrialEffects(Study(), {});
    Record(laws, kSigma, static_cast<std::uint64_t>(trial) + 100);
    const TrialEffects found = WeighTrialEffects(Study(), {});
    ASSERT_TRUE(found.fit.Usable()) << trial << ": " << found.fit.result.message;
    const std::map<std::string, double> sizes = {
        {"dampers of the joints", laws.linear},
        {"quadratic dampers of the joints", laws.quadratic},
        {"springs of the joints", laws.stiffness}};
    for (std::size_t i = 0; i < found.effects.size(); ++i) {
      const TrialEffect& e = found.effects[i];
      const auto size = sizes.find(e.effect.name);
      if (size == sizes.end()) continue;
      ++all;
      cannot += e.verdict == EffectVerdict::kCannotTell ? 1 : 0;
      if (size->second == 0.0) {
        ++absent;
        false_needed += e.verdict == EffectVerdict::kNeeded ? 1 : 0;
        continue;
      }
      // Plain: were there no noise, the fitted motion would move by more than what counts as moved.
      constexpr double kPart = 0.3;  // of a sigma, as the program has it
      if (!truth.fit.Usable() || truth.effects[i].change < kPart) continue;
      ++plain;
      false_not_needed += e.verdict == EffectVerdict::kNotNeeded ? 1 : 0;
    }
    if (found.left_out.empty()) continue;
    ++reduced;
    worst = std::max(worst, found.reduced_change);
    beyond += found.reduced_change > 0.3 ? 1 : 0;
  }
  fmt::print(
      "{} trials: needed of {} absent ones {}; not needed of {} plain ones {}; cannot be told "
      "{} of {}; {} reduced scenes, their marks within {:.2f} sigma; {:.0f} s of CPU\n",
      trials, absent, false_needed, plain, false_not_needed, cannot, all, reduced, worst,
      CpuSeconds() - start);
  EXPECT_LE(false_needed, 0.05 * absent + 1.0);
  EXPECT_LE(false_not_needed, 0.01 * plain + 0.5);
  EXPECT_EQ(beyond, 0);
}

// What a probability says comes true as often as it says: over laws drawn at random and of sizes
// that can just be told apart.
TEST_F(PlantedTest, ProbabilitiesOfRivalsComeTrue) {
  const int trials = Trials();
  const double start = CpuSeconds();
  const std::vector<data::Study> rivals = {LawStudy("linear", {"damper"}),
                                           LawStudy("quadratic", {"quadratic_damper"})};
  double promised = 0.0, right = 0.0, variance = 0.0;
  int sure = 0, sure_and_wrong = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng(12).Stream("rivals", static_cast<std::uint64_t>(trial));
    const bool quadratic = rng.Uniform() < 0.5;
    // Dampings that differ by 1 to 10 sigmas over the record, at their amplitudes.
    const double size = 2e-4 * std::pow(10.0, rng.Uniform());
    Record({.linear = quadratic ? 0.0 : size, .quadratic = quadratic ? size : 0.0}, kSigma,
           static_cast<std::uint64_t>(trial) + 500);
    const std::vector<Rival> found = WeighRivals(rivals, {});
    const bool hit = (found[0].name == "quadratic") == quadratic;
    const double p = found[0].probability;
    promised += p;
    right += hit ? 1.0 : 0.0;
    variance += p * (1.0 - p);
    sure += p > 0.99 ? 1 : 0;
    sure_and_wrong += p > 0.99 && !hit ? 1 : 0;
  }
  fmt::print(
      "{} trials: right {:.0f}, promised {:.1f} +- {:.1f}; surer than 0.99 {}, of them wrong "
      "{}; {:.0f} s of CPU\n",
      trials, right, promised, std::sqrt(variance), sure, sure_and_wrong, CpuSeconds() - start);
  EXPECT_NEAR(right, promised, 3.0 * std::sqrt(variance) + 1.0);
  EXPECT_LE(sure_and_wrong, 0.01 * sure + 1.0);
}

}  // namespace
}  // namespace unfurl::study::planted_slow_test
