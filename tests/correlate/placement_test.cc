// What is known of a record's clock and frame beforehand, in an alignment and in a fit: against
// Gaussian algebra written out, and against seeded repeats.
#include "correlate/placement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/statistics.h"
#include "correlate/align/align.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/repeats.h"

namespace unfurl::correlate::placement_test {
namespace {

SampledModel Reference() {
  return SampledModel(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), 0.0, 4.0, 1e-3);
}

Observations NoisyTrial(const Trial& trial, std::uint64_t seed) {
  Rng rng(seed);
  return Record(TwoLink(), TwoLink::Truth(), TwoLink::Marks(), trial, rng);
}

// Lengths measured too short by a tenth: a lens, a scale, a wrong bar.
Observations WithGain(Observations o, double gain) {
  for (MarkSeries& m : o.marks) m.p *= gain;
  return o;
}

// The same trial by a clock that runs fast, as read at the record's middle.
Observations WithDrift(Observations o, double drift) {
  const double pivot = o.Pivot();
  for (MarkSeries& m : o.marks) {
    for (double& t : m.t) t = pivot + (t - pivot) * (1.0 + drift);
  }
  return o;
}

TEST(Placement, AKnownClockIsNotMovedToHideAnotherError) {
  const Trial trial = TiltedTrial();
  Observations o = WithGain(NoisyTrial(trial, 1), 0.9);
  o.placement.offset = Prior::Known(trial.offset);
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable()) << a.message;
  EXPECT_EQ(a.at.offset, trial.offset);
  EXPECT_EQ(a.Sigma("time offset"), 0.0);
  EXPECT_THAT(a.unknowns, ::testing::Not(::testing::Contains("time offset")));
  EXPECT_GT(a.misfit, 50.0 * trial.sigma);
}

// Nothing of the record looks like the reference, and the clock is known: they are compared, and
// differ. With a prior of half a second they are records that share nothing.
TEST(Placement, AKnownClockIsComparedWhateverTheRecordShows) {
  const Trial trial = TiltedTrial();
  Rng rng(2);
  Observations o = Record(TwoLink(), std::vector<double>{3.1, 0.05}, {"elbow", "tip"}, trial, rng);
  EXPECT_FALSE(Align(o, Reference()).Usable());
  o.placement.offset = Prior::Normal(trial.offset, 0.5);
  EXPECT_FALSE(Align(o, Reference()).Usable());
  for (const Prior& known : {Prior::Known(trial.offset), Prior::Normal(trial.offset, 1e-3)}) {
    o.placement.offset = known;
    const Alignment a = Align(o, Reference());
    EXPECT_TRUE(a.Usable()) << a.message;
    EXPECT_NEAR(a.at.offset, trial.offset, 5e-3);
    EXPECT_LT(a.r2, 0.9);
  }
}

// Where frame and clock are known nothing is to be found, so nothing asks for many samples.
TEST(Placement, FewSamplesOfKnownPlaceAreCompared) {
  Trial trial = TiltedTrial();
  trial.before = 0.0, trial.duration = 3.9, trial.step = 0.8;
  Rng rng(4);
  Observations o = Record(TwoLink(), TwoLink::Truth(), {"tip"}, trial, rng);
  ASSERT_EQ(o.size(), 5U);
  EXPECT_FALSE(Align(o, Reference()).Usable());
  o.placement.offset = Prior::Known(trial.offset);
  EXPECT_FALSE(Align(o, Reference()).Usable()) << "six numbers of a frame";
  o.placement.frame.kind = Foreknowledge::kKnown;
  o.placement.frame.X_WM = trial.X_WM;
  for (const Prior& drift : {Prior{}, Prior::Known(0.0), Prior::Normal(0.0, 1e-6)}) {
    o.placement.drift = drift;
    const Alignment a = Align(o, Reference());
    ASSERT_TRUE(a.Usable()) << a.message;
    EXPECT_EQ(a.fit.known, 5U);
    EXPECT_EQ(a.at.offset, trial.offset);
    EXPECT_LT(a.fit.SumOfSquares(), 37.7);  // of 15 rows: beyond it lies one noise in a thousand
  }
  o.placement.drift = Prior::Free();
  EXPECT_FALSE(Align(o, Reference()).Usable()) << "a drift is sought";
  o.placement.drift = {};
  o.placement.offset = Prior::Normal(trial.offset, 1e-3);
  EXPECT_FALSE(Align(o, Reference()).Usable()) << "an offset is sought";
}

// Information adds: 1 / sigma^2 with a prior is that without one and that of the prior, and the
// values are their weighted mean, all other unknowns being integrated out [Kay 1993].
TEST(Placement, APriorAddsItsInformation) {
  const Trial trial = TiltedTrial();
  const Observations plain = NoisyTrial(trial, 3);
  AlignOptions drifting;
  drifting.registration.fit_drift = true;
  const Alignment free = Align(plain, Reference(), drifting);
  ASSERT_TRUE(free.Usable());
  const double sigma_offset = free.white_sigma(6), sigma_drift = free.white_sigma(7);
  Observations o = plain;
  o.placement.offset = Prior::Normal(trial.offset + 2.0 * sigma_offset, sigma_offset);
  const Alignment told = Align(o, Reference(), drifting);
  ASSERT_TRUE(told.Usable());
  EXPECT_NEAR(told.white_sigma(6), sigma_offset / std::sqrt(2.0), 0.01 * sigma_offset);
  EXPECT_NEAR(told.at.offset, 0.5 * (free.at.offset + o.placement.offset.mean),
              0.02 * sigma_offset);
  o.placement.offset = {};
  o.placement.drift = Prior::Normal(3.0 * sigma_drift, 0.5 * sigma_drift);
  const Alignment rate = Align(o, Reference());
  ASSERT_TRUE(rate.Usable());
  EXPECT_NEAR(rate.white_sigma(7), sigma_drift / std::sqrt(5.0), 0.01 * sigma_drift);
  EXPECT_NEAR(rate.drift, (free.drift + 4.0 * o.placement.drift.mean) / 5.0, 0.02 * sigma_drift);
}

TEST(Placement, AKnownDriftIsTakenOut) {
  constexpr double kDrift = 5e-4;
  const Trial trial = TiltedTrial();
  Observations o = WithDrift(NoisyTrial(trial, 4), kDrift);
  o.placement.drift = Prior::Known(kDrift);
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable());
  EXPECT_NEAR(a.drift, kDrift, 1e-15);
  EXPECT_NEAR(a.chi2_per_dof, 1.0, 5.0 * std::sqrt(2.0 / (3.0 * o.size())));
  EXPECT_EQ(a.Sigma("clock drift"), 0.0);
  o.placement.drift = Prior::Known(0.0);
  EXPECT_GT(Align(o, Reference()).chi2_per_dof, 1.5);
}

TEST(Placement, AKnownFrameIsNotTurned) {
  const Trial trial = TiltedTrial();
  Observations o = NoisyTrial(trial, 5);
  o.placement.frame = {Foreknowledge::kKnown, trial.X_WM, 0.0, 0.0};
  const Alignment a = Align(o, Reference());
  ASSERT_TRUE(a.Usable());
  EXPECT_EQ(a.at.X_WM.matrix(), trial.X_WM.matrix());
  EXPECT_EQ(a.unknowns, std::vector<std::string>{"time offset"});
  EXPECT_NEAR(a.at.offset, trial.offset, 5.0 * a.Sigma("time offset"));
  // All known: nothing is left to fit.
  o.placement.offset = Prior::Known(trial.offset);
  const Alignment all = Align(o, Reference());
  ASSERT_TRUE(all.Usable());
  EXPECT_TRUE(all.unknowns.empty());
  EXPECT_NEAR(all.chi2_per_dof, 1.0, 5.0 * std::sqrt(2.0 / (3.0 * o.size())));
}

TEST(Placement, APriorOfTheFrameHoldsWhatTheMarksLeaveOpen) {
  // One mark on a line: the marks know nothing of the turn about it.
  class OnALine : public Model {
   public:
    Prediction Evaluate(std::span<const double>, const Stamps& stamps) const override {
      Prediction out;
      for (const auto& list : stamps.t) {
        MarkMotion motion;
        motion.p.setZero(3, static_cast<Eigen::Index>(list.size()));
        motion.v.setZero(3, static_cast<Eigen::Index>(list.size()));
        for (std::size_t i = 0; i < list.size(); ++i) {
          const auto c = static_cast<Eigen::Index>(i);
          motion.p(0, c) = std::sin(2.0 * list[i]) + (out.marks.empty() ? 0.0 : 2.0 + list[i]);
          motion.v(0, c) = 2.0 * std::cos(2.0 * list[i]) + (out.marks.empty() ? 0.0 : 1.0);
        }
        out.marks.push_back(motion);
      }
      return out;
    }
  };
  Rng rng(4);
  Observations o = Record(OnALine(), {}, {"a", "b"}, Trial(), rng);
  constexpr double kRotation = 0.01, kShift = 5e-3;
  o.placement.frame = {Foreknowledge::kNormal, Pose::Identity(), kRotation, kShift};
  const Alignment a = Align(o, SampledModel(OnALine(), {}, {"a", "b"}, -1.0, 5.0, 1e-3));
  EXPECT_TRUE(a.fit.weak.empty());
  EXPECT_NEAR(a.Sigma("frame rotation about x"), kRotation, 1e-6);
  EXPECT_LT(a.Sigma("frame rotation about z"), 0.1 * kRotation);
}

// A hub that answers to an arm that swings on it, by a few milliradians; its two marks alone.
class Hub : public Model {
 public:
  static std::vector<std::string> Marks() { return {"left", "right"}; }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (std::size_t m = 0; m < stamps.marks.size(); ++m) {
      const double side = stamps.marks[m] == "left" ? -0.16 : 0.16;
      MarkMotion motion;
      const auto n = static_cast<Eigen::Index>(stamps.t[m].size());
      motion.p.setZero(3, n);
      motion.v.setZero(3, n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const double t = std::max(0.0, stamps.t[m][static_cast<std::size_t>(i)]);
        const double w = 2.0 * std::numbers::pi * theta[0];
        const double e = std::exp(-theta[1] * t);
        const double turn = 0.02 * (1.0 - e * std::cos(w * t));
        const double rate = stamps.t[m][static_cast<std::size_t>(i)] < 0.0
                                ? 0.0
                                : 0.02 * e * (theta[1] * std::cos(w * t) + w * std::sin(w * t));
        motion.p.col(i) << side * std::cos(turn), side * std::sin(turn), 0.0;
        motion.v.col(i) << -side * std::sin(turn) * rate, side * std::cos(turn) * rate, 0.0;
      }
      out.marks.push_back(std::move(motion));
    }
    return out;
  }
};

// From a start at which nothing looks alike: half a swing in place of two.
TEST(Placement, MarksOnTheHubAloneAreFittedWhenTheTriggerIsKnown) {
  const auto seeds = static_cast<std::size_t>(Repeats(16, 40));
  constexpr double k95 = 1.959964, kTrigger = 1e-3;
  const std::vector<double> truth = {0.55, 0.9};
  std::size_t usable = 0, found = 0, held[2] = {0, 0}, held_of_found[2] = {0, 0};
  const auto count = [&](const FitResult& fit, std::size_t* fits, std::size_t* hold) {
    if (!fit.Usable()) return;
    ++*fits;
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      hold[j] += std::abs(e.value - truth[j]) <= k95 * e.sigma ? 1 : 0;
    }
  };
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    Rng rng(400 + seed);
    Trial trial = SparseTrial();
    trial.sigma = 1e-4;
    Observations data = Record(Hub(), truth, Hub::Marks(), trial, rng);
    const Hub model;
    FitProblem problem;
    problem.parameters = TwoLinkParameters();
    problem.parameters[0].start = 0.8;
    problem.parameters[0].low = 0.1;
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    FitOptions options;
    options.profile.wanted = false;
    options.workers = 1;
    count(Fit(problem, options), &found, held_of_found);
    data.placement.offset = Prior::Normal(trial.offset + kTrigger * rng.Normal(), kTrigger);
    count(Fit(problem, options), &usable, held);
  }
  EXPECT_EQ(usable, seeds);
  for (int j = 0; j < 2; ++j) {
    EXPECT_GE(BinomialInterval(held[j], usable, 0.999).second, 0.95) << held[j];
    // Without it some may find nothing to align, and what is found is right.
    EXPECT_GE(BinomialInterval(held_of_found[j], found, 0.999).second, 0.95)
        << held_of_found[j] << " of " << found;
  }
}

FitResult FitTwoLink(const Observations& data, const FitOptions& how = {}) {
  const TwoLink model;
  FitProblem problem;
  problem.parameters = TwoLinkParameters();
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  FitOptions options = how;
  options.profile.wanted = false;
  options.workers = 1;
  return Fit(problem, options);
}

Observations SparseData(std::uint64_t seed) {
  Rng rng(seed);
  return Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, SparseTrial(), rng);
}

TEST(ClockDrift, IsTakenIntoAFitWhenTheDataCallForIt) {
  const int seeds = Repeats(10, 30);
  constexpr double kDrift = 1e-3, k95 = 1.959964;
  int called = 0, falsely = 0, held[2] = {0, 0};
  std::vector<double> z;
  for (int seed = 0; seed < seeds; ++seed) {
    const Observations data = SparseData(600 + static_cast<std::uint64_t>(seed));
    falsely += FitTwoLink(data).trials[0].drift.called ? 1 : 0;
    const FitResult fit = FitTwoLink(WithDrift(data, kDrift));
    ASSERT_TRUE(fit.Usable()) << fit.message;
    called += fit.trials[0].drift.called ? 1 : 0;
    const auto names = NamesOf(fit.trials[0].nuisances);
    const auto at = std::find(names.begin(), names.end(), "clock drift");
    ASSERT_NE(at, names.end());
    z.push_back((fit.trials[0].at.drift - kDrift) /
                fit.trials[0].nuisance_sigma(at - names.begin()));
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      held[j] += std::abs(e.value - TwoLink::Truth()[j]) <= k95 * e.sigma ? 1 : 0;
    }
  }
  EXPECT_EQ(called, seeds);
  EXPECT_LE(falsely, 2);  // of 30 at most, at a probability of 0.009 each
  EXPECT_NEAR(Mean(z), 0.0, 4.0 / std::sqrt(seeds));
  EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / seeds));
  for (int j = 0; j < 2; ++j) {
    EXPECT_GE(
        BinomialInterval(static_cast<std::size_t>(held[j]), static_cast<std::size_t>(seeds), 0.999)
            .second,
        0.95);
  }
}

TEST(ClockDrift, KnownToBeNoneIsNotFitted) {
  Observations data = WithDrift(SparseData(7), 1e-3);
  data.placement.drift = Prior::Known(0.0);
  const FitResult fit = FitTwoLink(data);
  EXPECT_FALSE(fit.trials[0].drift.called);
  EXPECT_EQ(fit.trials[0].at.drift, 0.0);
  EXPECT_THAT(NamesOf(fit.trials[0].nuisances), ::testing::Not(::testing::Contains("clock drift")));
}

// A model whose time runs 3% fast is no matter of the clock.
TEST(ClockDrift, ThatNoClockHasIsTheModels) {
  const FitResult fit = FitTwoLink(WithDrift(SparseData(8), 0.03));
  EXPECT_FALSE(fit.trials[0].drift.called);
  EXPECT_TRUE(fit.trials[0].drift.too_large);
  EXPECT_EQ(fit.trials[0].goodness.outcome, Explained::kNo);
}

}  // namespace
}  // namespace unfurl::correlate::placement_test
