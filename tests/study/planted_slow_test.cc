// Effects planted in trials, and what is said of them: 30 trials, or UNFURL_PLANTED_TRIALS.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "base/cpu_time.h"
#include "base/random.h"
#include "data/atomic_file.h"
#include "data/study.h"
#include "study/rivals.h"
#include "study/scene_model.h"
#include "study/trial_effects.h"
#include "tests/own_folder.h"
#include "tests/study/swing.h"

namespace unfurl::study::planted_slow_test {
namespace {

// Fits of a record of little noise take more steps.
constexpr double kTruthBudget = 10.0;

int Trials() {
  const char* asked = std::getenv("UNFURL_PLANTED_TRIALS");
  return asked != nullptr ? std::atoi(asked) : 30;
}

// Of an effect that half of the trials have, from what nobody sees to what is plain.
double Size(Rng& rng, double low, double high) {
  const bool there = rng.Uniform() < 0.5;
  const double x = low * std::pow(high / low, rng.Uniform());
  return there ? x : 0.0;
}

// What was said of what was planted; the truth is what a record without noise says of the same
// study.
class Counts {
 public:
  // `sizes`: of what was planted by the effect's name, 0 where it is absent.
  void Take(const std::map<std::string, double>& sizes, const TrialEffects& truth,
            const TrialEffects& found) {
    for (std::size_t i = 0; i < found.effects.size(); ++i) {
      const TrialEffect& e = found.effects[i];
      const auto size = sizes.find(e.effect.name);
      if (size == sizes.end()) continue;
      ++all_;
      cannot_ += e.verdict == EffectVerdict::kCannotTell ? 1 : 0;
      if (size->second == 0.0) {
        ++absent_;
        false_needed_ += e.verdict == EffectVerdict::kNeeded ? 1 : 0;
        continue;
      }
      // Plain: were there no noise, the fitted motion would move by more than what counts as moved.
      constexpr double kPart = 0.3;  // of a sigma, as the program has it
      if (!truth.fit.Usable() || truth.effects[i].change < kPart) continue;
      ++plain_;
      false_not_needed_ += e.verdict == EffectVerdict::kNotNeeded ? 1 : 0;
    }
    if (found.left_out.empty()) return;
    ++reduced_;
    worst_ = std::max(worst_, found.reduced_change);
    beyond_ += found.reduced_change > 0.3 ? 1 : 0;
  }

  void Judge(int trials, double cpu) const {
    fmt::print(
        "{} trials: needed of {} absent ones {}; not needed of {} plain ones {}; cannot be told "
        "{} of {}; {} reduced scenes, their marks within {:.2f} sigma; {:.0f} s of CPU\n",
        trials, absent_, false_needed_, plain_, false_not_needed_, cannot_, all_, reduced_, worst_,
        cpu);
    EXPECT_LE(false_needed_, 0.05 * absent_ + 1.0);
    EXPECT_LE(false_not_needed_, 0.01 * plain_ + 0.5);
    EXPECT_EQ(beyond_, 0);
  }

 private:
  int absent_ = 0, false_needed_ = 0, plain_ = 0, false_not_needed_ = 0, cannot_ = 0, all_ = 0;
  int reduced_ = 0, beyond_ = 0;
  double worst_ = 0.0;
};

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

  static Laws Draw(Rng& rng) {
    Laws laws;
    laws.linear = Size(rng, 2e-4, 0.05);
    laws.quadratic = Size(rng, 2e-4, 0.05);
    laws.stiffness = Size(rng, 1e-3, 0.5);
    return laws;
  }
};

TEST_F(PlantedTest, WhatIsPlantedIsFoundAndWhatIsNotIsNot) {
  const int trials = Trials();
  const double start = CpuSeconds();
  Counts counts;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng(11).Stream("planted", static_cast<std::uint64_t>(trial));
    const Laws laws = Draw(rng);
    Record(laws, 1e-9 * kSigma, 1);
    const TrialEffects truth = WeighTrialEffects(Study(), {.budget = kTruthBudget});
    Record(laws, kSigma, static_cast<std::uint64_t>(trial) + 100);
    const TrialEffects found = WeighTrialEffects(Study(), {});
    ASSERT_TRUE(found.fit.Usable()) << trial << ": " << found.fit.result.message;
    counts.Take({{"dampers of the joints", laws.linear},
                 {"quadratic dampers of the joints", laws.quadratic},
                 {"springs of the joints", laws.stiffness},
                 {"friction of the joints", 0.0}},  // which the scene lacks
                truth, found);
  }
  counts.Judge(trials, CpuSeconds() - start);
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

// A boom that unfolds, latches and rings, seen by two marks in space.
class PlantedBoomTest : public ::testing::Test {
 protected:
  static constexpr double kSigma = 3e-4;  // [m]
  struct Sizes {
    double linear = 0.0, quadratic = 0.0, beam = 0.0, clearance = 0.0;  // [N m s, N m s^2, s, rad]
  };

  static Sizes Draw(Rng& rng) {
    return {.linear = Size(rng, 1e-5, 1e-2),
            .quadratic = Size(rng, 1e-5, 1e-2),
            .beam = Size(rng, 1e-7, 3e-4),
            .clearance = Size(rng, 1e-6, 1e-2)};
  }

  std::string Put(const std::string& name, const std::string& text) const {
    data::WriteTextFile((own_.path() / name).string(), text);
    return (own_.path() / name).string();
  }

  static std::string Scene(const Sizes& s) {
    std::string text = R"([scene]
name = "boom"
duration = 1.6
[body.root]
mass = 0.15
inertia = 1e-4
[beam.boom]
length = 0.8
mass = 0.4
E = 6.9e10
I = 2.7e-10
segments = 2
[joint.hinge]
inner = "ground"
outer = "root"
outer_point = [-0.01, 0.0]
theta = 1.0
[joint.hinge.spring]
stiffness = 0.2
preload = 0.5
[joint.hinge.latch]
lever = 0.02
contact = "lock"
[contact.lock]
radius_i = 0.005
modulus_i = 2.0e11
poisson_i = 0.3
modulus_j = 6.9e10
poisson_j = 0.3
mass = 0.4
linear_stiffness = 3.2e9
restitution = 0.85
Q = 3.0
epsilon = 5e-6
[weld.boom]
inner = "root"
inner_point = [0.01, 0.0]
outer = "boom.start"
[mark.tip]
on = "boom.end"
[mark.near]
on = "root"
point = [0.01, 0.0]
)";
    auto add = [&](const char* law, double damping) {
      if (damping > 0.0) text += fmt::format("[joint.hinge.{}]\ndamping = {}\n", law, damping);
    };
    add("damper", s.linear);
    add("quadratic_damper", s.quadratic);
    return text;
  }

  static std::vector<std::string> Set(const Sizes& s) {
    return {fmt::format("beam.boom.damping={}", s.beam),
            fmt::format("joint.hinge.latch.theta_a={}", s.clearance),
            fmt::format("joint.hinge.latch.theta_b={}", s.clearance)};
  }

  // Each mark every 5 ms.
  void Record(const Sizes& sizes, double sigma, std::uint64_t seed) const {
    SceneModelOptions options;
    options.scene = Put("truth.toml", Scene(sizes));
    options.set = Set(sizes);
    options.rtol = 1e-7;
    const SceneModel model(options, {});
    correlate::Stamps stamps;
    stamps.marks = model.marks();
    stamps.t.resize(stamps.marks.size());
    for (std::vector<double>& t : stamps.t) {
      for (int i = 0; i < 318; ++i) t.push_back(0.005 * i);
    }
    const correlate::Prediction truth = model.Evaluate({}, stamps);
    Rng rng(seed);
    std::string text =
        "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
        "[m^2]\n";
    for (std::size_t i = 0; i < stamps.t[0].size(); ++i) {
      for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
        const Eigen::Vector3d p = truth.marks[m].p.col(static_cast<Eigen::Index>(i));
        text +=
            fmt::format("{:.3f},{},{:.12f},{:.12f},{:.12f},{},0,0,{},0,{}\n", stamps.t[m][i],
                        stamps.marks[m], p.x() + sigma * rng.Normal(), p.y() + sigma * rng.Normal(),
                        sigma * rng.Normal(), kSigma * kSigma, kSigma * kSigma, kSigma * kSigma);
      }
    }
    Put("tracks.csv", text);
  }

  data::Study Study() const {
    const Sizes start = {.linear = 1e-3, .quadratic = 1e-3, .beam = 3e-5, .clearance = 1e-3};
    Put("scene.toml", Scene(start));
    std::string set;
    for (const std::string& one : Set(start)) set += fmt::format("\"{}\", ", one);
    std::string text = fmt::format(
        "[study]\nscene = \"scene.toml\"\nset = [{}]\n[trial]\ntracks = \"tracks.csv\"\n"
        "offset = 0.0\nframe = \"known\"\n[fidelity]\nwanted = false\n",
        set);
    auto add = [&](const char* name, const char* keys, double at, double most) {
      text += fmt::format("[parameter.{}]\nkeys = [{}]\nstart = {}\nbounds = [1e-9, {}]\n", name,
                          keys, at, most);
    };
    add("linear", "\"joint.hinge.damper.damping\"", start.linear, 0.1);
    add("quadratic", "\"joint.hinge.quadratic_damper.damping\"", start.quadratic, 0.1);
    add("beam", "\"beam.boom.damping\"", start.beam, 1e-2);
    add("clearance", "\"joint.hinge.latch.theta_a\", \"joint.hinge.latch.theta_b\"",
        start.clearance, 0.05);
    return data::ReadStudy(Put("study.toml", text));
  }

  const OwnFolder own_;
};

TEST_F(PlantedBoomTest, WhatIsPlantedIsFoundAndWhatIsNotIsNot) {
  const int trials = Trials();
  const double start = CpuSeconds();
  Counts counts;
  for (int trial = 0; trial < trials; ++trial) {
    Rng rng = Rng(13).Stream("planted", static_cast<std::uint64_t>(trial));
    const Sizes sizes = Draw(rng);
    // With none at all its noise would be the integration's, which is not white.
    Record(sizes, 1e-2 * kSigma, static_cast<std::uint64_t>(trial) + 100);
    const TrialEffects truth = WeighTrialEffects(Study(), {.budget = kTruthBudget});
    Record(sizes, kSigma, static_cast<std::uint64_t>(trial) + 100);
    const TrialEffects found = WeighTrialEffects(Study(), {});
    ASSERT_TRUE(found.fit.Usable()) << trial << ": " << found.fit.result.message;
    counts.Take({{"dampers of the joints", sizes.linear},
                 {"quadratic dampers of the joints", sizes.quadratic},
                 {"damping of the beams", sizes.beam},
                 {"clearance", sizes.clearance}},
                truth, found);
  }
  counts.Judge(trials, CpuSeconds() - start);
}

}  // namespace
}  // namespace unfurl::study::planted_slow_test
