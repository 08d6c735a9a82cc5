// Fits on a ladder of models whose rungs and fixed point are closed forms.
#include "correlate/fit/ladder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <numbers>

#include "base/error.h"
#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/fit/evaluation_store.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/timed_events.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/stopped_workers.h"
#include "tests/correlate/two_link.h"
#include "tests/own_folder.h"

namespace unfurl::correlate::ladder_test {
namespace {

// The two-link arm with its parameters changed first; latches as given.
class Changed : public TwoLink {
 public:
  using Change = std::function<std::vector<double>(std::span<const double>)>;
  explicit Changed(Change change, std::vector<ModelEvent> latches = {})
      : change_(std::move(change)), latches_(std::move(latches)) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    ++count;
    Prediction out = TwoLink::Evaluate(change_(theta), stamps);
    out.events = latches_;
    return out;
  }
  mutable std::atomic<int> count = 0;

 private:
  Change change_;
  std::vector<ModelEvent> latches_;
};

// Frequency and decay off by parts that fall with the square of the spacing.
Changed::Change Mesh(double spacing) {
  return [part = 0.004 * spacing * spacing](std::span<const double> theta) {
    return std::vector<double>{theta[0] * (1.0 - part), theta[1] * (1.0 + 2.0 * part)};
  };
}

// Answers to the frequency with `gain` times the change that it should have, about `centre`.
Changed::Change Gain(double gain, double centre) {
  return [=](std::span<const double> theta) {
    return std::vector<double>{centre + gain * (theta[0] - centre), theta[1]};
  };
}

Observations Data(const Model& nature, std::uint64_t seed) {
  Rng rng(seed);
  return Record(nature, TwoLink::Truth(), TwoLink::Marks(), SparseTrial(), rng);
}

FitProblem Problem(const Observations& data, const Model& lowest, const std::vector<Rung>& rungs) {
  FitProblem problem;
  problem.parameters = TwoLinkParameters();
  problem.trials.resize(1);
  problem.trials[0].observations = &data;
  problem.trials[0].model = &lowest;
  problem.trials[0].rungs = rungs;
  return problem;
}

FitResult FitQuick(const FitProblem& problem) {
  FitOptions options;
  options.profile.wanted = false;
  return Fit(problem, options);
}

constexpr double kMiddle = 2.0 / 3.0, kFine = 0.5;  // spacings; the coarse one is 1

TEST(Ladder, GivesTheFinestRungsAnswer) {
  const Changed coarse(Mesh(1.0)), middle(Mesh(kMiddle)), fine(Mesh(kFine)), exact(Mesh(0.0));
  const Observations data = Data(exact, 3);
  const FitResult ladder = FitQuick(Problem(
      data, coarse, {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}}));
  const int fine_runs = fine.count;
  const FitResult direct = FitQuick(Problem(data, fine, {}));
  ASSERT_TRUE(ladder.Usable()) << ladder.message;
  EXPECT_TRUE(ladder.ladder.settled);
  EXPECT_EQ(ladder.ladder.base, 0u);
  EXPECT_LE(fine_runs, 4 + ladder.ladder.followed);
  EXPECT_THAT(ladder.ladder.runs,
              ::testing::ElementsAre(::testing::Gt(9u),
                                     static_cast<std::size_t>(1 + ladder.ladder.followed),
                                     static_cast<std::size_t>(fine_runs)));
  for (std::size_t j = 0; j < 2; ++j) {
    const ParameterEstimate &a = ladder.parameters[j], &b = direct.parameters[j];
    EXPECT_NEAR(a.value, b.value, 0.1 * a.sigma) << j;
    // Without noise the answer would be the finest rung's own error, in closed form.
    const double part = 0.004 * kFine * kFine;
    const double expected =
        j == 0 ? TwoLink::Truth()[0] / (1.0 - part) : TwoLink::Truth()[1] / (1.0 + 2.0 * part);
    EXPECT_NEAR(a.value, expected, 4.0 * a.sigma_data) << j;
  }
}

// What the finest rung lacks is found from the two changes, with its direction: the interval holds
// the truth and is narrower than one of both directions.
TEST(Ladder, WhatIsLeftReachesToTheTruth) {
  const Changed coarse(Mesh(1.0)), middle(Mesh(kMiddle)), fine(Mesh(kFine)), exact(Mesh(0.0));
  const Observations data = Data(exact, 4);
  const FitResult fit = FitQuick(Problem(
      data, coarse, {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}}));
  ASSERT_TRUE(fit.Usable());
  EXPECT_TRUE(fit.ladder.one_sided);
  const ParameterEstimate& frequency = fit.parameters[0];
  const double left = TwoLink::Truth()[0] * 0.004 * kFine * kFine;  // to first order
  EXPECT_NEAR(frequency.model_shift, -left, 0.1 * left);
  EXPECT_LT(frequency.all95.low, TwoLink::Truth()[0]);
  EXPECT_GT(frequency.all95.high, frequency.value);
  EXPECT_GT(frequency.value - frequency.all95.low, 2.0 * (frequency.all95.high - frequency.value));
  // Two rungs alone tell the size and not its certainty.
  const FitResult two = FitQuick(Problem(data, coarse, {{&fine, "fine", kFine * kFine}}));
  ASSERT_TRUE(two.Usable());
  EXPECT_FALSE(two.ladder.one_sided);
  EXPECT_GT(two.parameters[0].all95.high - two.parameters[0].all95.low,
            1.5 * (frequency.all95.high - frequency.all95.low));
  // Rungs of unknown error: the whole last change stands for what is left, 3 times a Richardson's.
  const FitResult unknown = FitQuick(Problem(data, coarse, {{&fine, "fine", 0.0}}));
  EXPECT_NEAR(unknown.parameters[0].model_shift, 3.0 * two.parameters[0].model_shift,
              0.05 * std::abs(unknown.parameters[0].model_shift));
}

// The lowest rung answers a parameter 0.7 times as much as nature does: to first order, by its
// slopes, what is left would be 1 / 0.7 times what it is.
TEST(Ladder, WhatIsLeftDoesNotHangOnTheLowestRungsSlopes) {
  const double centre = 0.9 * TwoLink::Truth()[0];
  auto weak = [&](double spacing) { return Gain(1.0 - 0.3 * spacing * spacing, centre); };
  const Changed coarse(weak(1.0)), middle(weak(kMiddle)), fine(weak(kFine)), exact(weak(0.0));
  const FitResult fit =
      FitQuick(Problem(Data(exact, 6), coarse,
                       {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}}));
  ASSERT_TRUE(fit.Usable()) << fit.message;
  const ParameterEstimate& frequency = fit.parameters[0];
  const double gain = 1.0 - 0.3 * kFine * kFine;
  const double left = (TwoLink::Truth()[0] - centre) * (1.0 / gain - 1.0);
  EXPECT_NEAR(frequency.model_shift, -left,
              4.0 * std::hypot(frequency.sigma_data, frequency.sigma_doubt));
  EXPECT_LT(std::hypot(frequency.sigma_data, frequency.sigma_doubt), 0.05 * left);
  EXPECT_GE(fit.ladder.followed, 1);
  EXPECT_LE(frequency.all95.low, TwoLink::Truth()[0]);
}

// A coarse rung that answers too little: each step overshoots by 1 / gain - 1.
TEST(Ladder, ASlowWayTakesTheSlopeIn) {
  const double centre = TwoLink::Truth()[0] - 0.002;
  const Changed coarse(Gain(0.65, centre)), fine(Mesh(0.0));
  const Observations data = Data(fine, 5);
  const FitResult fit = FitQuick(Problem(data, coarse, {{&fine, "fine", 0.0}}));
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.ladder.base, 0u);
  EXPECT_TRUE(std::any_of(fit.ladder.rounds.begin(), fit.ladder.rounds.end(),
                          [](const LadderRound& r) { return r.slope && r.counted; }));
  // Without it each step is 1 / gain - 1 = 0.54 of the one before: from the first of these down to
  // a twentieth of a standard error.
  double first = 0.0;
  std::size_t steps = 0;
  for (const LadderRound& r : fit.ladder.rounds) {
    if (!(r.step > 0.0)) continue;
    if (steps++ == 0) first = r.step;
  }
  EXPECT_GT(first, 1.0);
  EXPECT_LT(static_cast<double>(steps), std::log(0.05 / first) / std::log(1.0 / 0.65 - 1.0));
  EXPECT_NEAR(fit.parameters[0].value, TwoLink::Truth()[0], 4.0 * fit.parameters[0].sigma_data);
}

// With less than half of the answer each step is worse than none: the round does not count, and the
// slope alone brings the fit home.
TEST(Ladder, ARoundWhoseCostRisesDoesNotCount) {
  const double centre = TwoLink::Truth()[0] - 0.002;
  const Changed coarse(Gain(0.4, centre)), fine(Mesh(0.0));
  const Observations data = Data(fine, 6);
  const FitResult fit = FitQuick(Problem(data, coarse, {{&fine, "fine", 0.0}}));
  ASSERT_TRUE(fit.Usable()) << fit.message;
  const auto& rounds = fit.ladder.rounds;
  EXPECT_TRUE(
      std::any_of(rounds.begin(), rounds.end(), [](const LadderRound& r) { return !r.counted; }));
  double best = rounds.front().fine_cost;
  for (const LadderRound& r : rounds) {
    if (&r == &rounds.front() || r.base != rounds.front().base) continue;
    if (!r.counted) continue;
    EXPECT_LT(r.fine_cost, best);
    best = r.fine_cost;
  }
  EXPECT_NEAR(fit.parameters[0].value, TwoLink::Truth()[0], 4.0 * fit.parameters[0].sigma_data);
}

TEST(Ladder, AnotherOrderOfLatchesGoesUpARung) {
  const std::vector<ModelEvent> one = {{1.0, "latch", "a"}, {1.2, "latch", "b"}};
  const std::vector<ModelEvent> other = {{1.0, "latch", "b"}, {1.2, "latch", "a"}};
  const Changed coarse(Mesh(1.0), one), middle(Mesh(kMiddle), other), fine(Mesh(kFine), other);
  const Observations data = Data(fine, 7);
  const FitResult fit = FitQuick(Problem(
      data, coarse, {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}}));
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.ladder.base, 1u);
  EXPECT_THAT(fit.ladder.notes, ::testing::Contains(::testing::HasSubstr("a latches before b")));
  EXPECT_NEAR(fit.parameters[0].value, TwoLink::Truth()[0], 4.0 * fit.parameters[0].sigma_data);
  // Without a rung between, the finest is fitted itself.
  const FitResult itself = FitQuick(Problem(data, coarse, {{&fine, "fine", kFine * kFine}}));
  ASSERT_TRUE(itself.Usable());
  EXPECT_EQ(itself.ladder.base, 1u);
  EXPECT_GT(itself.parameters[0].sigma_model, 0.0);
  EXPECT_GT(fit.parameters[0].sigma_model, 0.0);
  EXPECT_TRUE(itself.ladder.settled);
  EXPECT_NEAR(itself.parameters[0].value, TwoLink::Truth()[0],
              4.0 * itself.parameters[0].sigma_data);
}

TEST(Ladder, LatchesDifferByKindAndOrderBeyondTheResolution) {
  Prediction a, b;
  a.events = {{1.0, "latch", "x"}, {1.002, "latch", "y"}, {1.5, "contact_start", "x"}};
  b.events = {{1.003, "latch", "x"}, {1.001, "latch", "y"}};
  EXPECT_EQ(LatchesDiffer(a, b, 0.005), "");
  EXPECT_THAT(LatchesDiffer(a, b, 0.001), ::testing::HasSubstr("x latches before y"));
  b.events.pop_back();
  EXPECT_THAT(LatchesDiffer(a, b, 0.005), ::testing::HasSubstr("y latches at"));
  EXPECT_EQ(LatchesDiffer(a, a, 0.0), "");
}

TEST(Ladder, AFinestRungThatFailsLeavesTheLowestAndSaysSo) {
  class Broken : public TwoLink {
   public:
    Prediction Evaluate(std::span<const double>, const Stamps&) const override {
      Prediction out;
      out.status = ModelStatus::kFailed;
      out.message = "no licence";
      return out;
    }
  };
  const Broken fine;
  const TwoLink coarse;
  const Observations data = Data(coarse, 8);
  const FitResult fit = FitQuick(Problem(data, coarse, {{&fine, "fine", 0.25}}));
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_EQ(fit.trials[0].error_check, ErrorCheck::kNone);
  EXPECT_EQ(fit.trials[0].error_check_failure, "no licence");
}

TEST(Ladder, TrialsWithDifferentRungsAreRefused) {
  const TwoLink model;
  const Observations data = Data(model, 9);
  FitProblem problem = Problem(data, model, {{&model, "fine", 0.25}});
  problem.trials.push_back(problem.trials[0]);
  problem.trials[1].rungs.clear();
  EXPECT_THROW(Fit(problem), Error);
}

// Stopped after any number of evaluations, and resumed with the journal: the same bits.
TEST(Ladder, IsResumedToTheSameBits) {
  const OwnFolder folder;
  const std::string result = folder.File("fit.h5");
  const Changed coarse(Mesh(1.0)), middle(Mesh(kMiddle)), fine(Mesh(kFine));
  const Observations data = Data(TwoLink(), 10);
  const FitProblem problem = Problem(
      data, coarse, {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}});
  FitOptions options;
  const FitResult whole = Fit(problem, options);
  ASSERT_TRUE(whole.Usable());
  const auto threads = LocalWorkers(2);
  const int count = static_cast<int>(whole.evaluations.size());
  for (int stop = 0; stop < count; stop += 5) {
    {
      data::Journal journal(result, "same", false);
      Stopped stopped(*threads, stop);
      JournaledWorkers workers(stopped, journal);
      options.where = &workers;
      EXPECT_THROW(Fit(problem, options), Interrupted);
    }
    data::Journal journal(result, "same", true);
    JournaledWorkers workers(*threads, journal);
    options.where = &workers;
    const FitResult resumed = Fit(problem, options);
    ASSERT_EQ(resumed.evaluations.size(), whole.evaluations.size());
    ASSERT_EQ(resumed.ladder.rounds.size(), whole.ladder.rounds.size());
    for (std::size_t i = 0; i < whole.ladder.rounds.size(); ++i) {
      EXPECT_EQ(resumed.ladder.rounds[i].fine_cost, whole.ladder.rounds[i].fine_cost);
    }
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_EQ(resumed.parameters[j].value, whole.parameters[j].value);
      EXPECT_EQ(resumed.parameters[j].all95.low, whole.parameters[j].all95.low);
    }
    journal.Remove();
  }
}

// A chain of two links of five parameters in closed form: frequency and decay of the first link,
// size, rate and swing of the second. Coarse meshes have all of them off.
class FiveParameters : public Model {
 public:
  explicit FiveParameters(double spacing) : part_(0.003 * spacing * spacing) {}
  static std::vector<double> Truth() { return {0.9, 0.35, 0.8, 2.0, 0.1}; }
  static std::vector<Parameter> Parameters() {
    const char* const names[] = {"frequency", "decay", "size", "rate", "swing"};
    const std::vector<double> truth = Truth();
    std::vector<Parameter> all(5);
    for (std::size_t j = 0; j < 5; ++j) {
      all[j].name = names[j];
      all[j].start = truth[j] * (j % 2 == 0 ? 1.03 : 0.9);
      all[j].low = 0.3 * truth[j], all[j].high = 3.0 * truth[j];
    }
    return all;
  }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    constexpr double kStep = 1e-6;
    Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
      motion.p.setZero(3, n);
      motion.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = stamps.t[m][static_cast<std::size_t>(i)];
        motion.p.col(i) = Position(theta, stamps.marks[m], std::max(0.0, t));
        if (t < 0.0) continue;
        motion.v.col(i) = (Position(theta, stamps.marks[m], t + kStep) - motion.p.col(i)) / kStep;
      }
      out.marks.push_back(std::move(motion));
    }
    return out;
  }

 private:
  Eigen::Vector3d Position(std::span<const double> theta, const std::string& mark, double t) const {
    auto off = [&](std::size_t j, double sign) { return theta[j] * (1.0 + sign * part_); };
    const double q1 =
        1.2 * std::exp(-off(1, 2.0) * t) * std::cos(2.0 * std::numbers::pi * off(0, -1.0) * t);
    const double q2 = q1 + off(2, 1.5) * (1.0 - std::exp(-off(3, -2.0) * t)) +
                      off(4, 3.0) * (1.0 - std::cos(7.0 * t));
    auto along = [](double a, double length) {
      return Eigen::Vector3d(length * std::cos(a), length * std::sin(a), 0.0);
    };
    const Eigen::Vector3d elbow = along(0.05 * std::sin(2.5 * t), 0.2) + along(q1, 0.8);
    if (mark == "base") return along(0.05 * std::sin(2.5 * t), -0.16);
    return mark == "elbow" ? elbow : Eigen::Vector3d(elbow + along(q2, 0.8));
  }
  double part_;
};

// Five parameters, two trials, a prior, stages: as many fine runs a round as there are trials, the
// finest rung's own answer, and intervals that hold, counted over seeds.
TEST(Ladder, FiveParametersTwoTrialsAPriorAndStages) {
  const FiveParameters coarse(1.0), middle(kMiddle), fine(kFine), exact(0.0);
  const std::vector<double> truth = FiveParameters::Truth();
  const std::vector<std::string> marks = {"base", "elbow", "tip"};
  constexpr std::size_t kSeeds = 8;
  std::atomic<std::size_t> held = 0;
  ParallelFor(kSeeds, 0, [&](std::size_t seed) {
    Rng rng(12 + seed);
    Trial second = SparseTrial();
    second.offset = -0.4;
    const Observations a = Record(exact, truth, marks, SparseTrial(), rng);
    const Observations b = Record(exact, truth, marks, second, rng);
    auto problem = [&](const Model& lowest, const std::vector<Rung>& rungs) {
      FitProblem out;
      out.parameters = FiveParameters::Parameters();
      out.parameters[4].has_prior = true;
      out.parameters[4].prior_mean = truth[4];
      out.parameters[4].prior_sigma = 1e-4;
      for (const Observations* o : {&a, &b}) {
        FitTrial trial;
        trial.name = o == &a ? "one" : "two";
        trial.observations = o;
        trial.model = &lowest;
        trial.rungs = rungs;
        out.trials.push_back(trial);
      }
      return out;
    };
    FitOptions options;
    options.profile.wanted = false;
    options.stages = {1.0, 2.0};
    options.workers = 1;
    const FitResult ladder = Fit(
        problem(coarse, {{&middle, "middle", kMiddle * kMiddle}, {&fine, "fine", kFine * kFine}}),
        options);
    ASSERT_TRUE(ladder.Usable()) << ladder.message;
    const FitResult direct = Fit(problem(fine, {}), options);
    const std::size_t rounds = ladder.ladder.rounds.size();
    // Some 200 standard errors off, the way to the truth bends.
    EXPECT_GE(ladder.ladder.followed, 1);
    const auto extra = static_cast<std::size_t>(ladder.ladder.followed);
    EXPECT_LE(ladder.ladder.runs.back(), 2 * (rounds + extra));  // one a round and trial
    EXPECT_LE(rounds, 5u);
    for (std::size_t j = 0; j < 5; ++j) {
      const ParameterEstimate &x = ladder.parameters[j], &y = direct.parameters[j];
      EXPECT_NEAR(x.value, y.value, 0.1 * x.sigma) << j;
      EXPECT_NEAR(x.value + x.model_shift, truth[j], 4.0 * std::hypot(x.sigma_data, x.sigma_doubt))
          << j;
      held += x.all95.low <= truth[j] && truth[j] <= x.all95.high ? 1 : 0;
    }
    // The prior is at work: swing is known no worse than beforehand.
    EXPECT_LT(ladder.parameters[4].sigma_data, 1e-4);
  });
  EXPECT_GE(BinomialInterval(held, 5 * kSeeds, 0.999).second, 0.95) << held << " of " << 5 * kSeeds;
}

}  // namespace
}  // namespace unfurl::correlate::ladder_test
