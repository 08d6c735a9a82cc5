// Moments told by something else than the marks, as residuals of their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/timed_events.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"
#include "tests/repeats.h"

namespace unfurl::correlate::events_test {
namespace {

// The two-link arm with a switch that tells when its first link passes zero: cos(2 pi f t) = 0.
class Switched : public TwoLink {
 public:
  static constexpr int kPassings = 4;
  static double Passing(double frequency, int count) { return (0.5 * count - 0.25) / frequency; }
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out = TwoLink::Evaluate(theta, stamps);
    for (int k = 1; k <= kPassings; ++k) {
      out.events.push_back({Passing(theta[0], k), "latch", "elbow"});
    }
    return out;
  }
};

Observations WithEvents(const Trial& trial, double sigma, Rng& rng) {
  Observations data = Record(TwoLink(), TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
  std::vector<TimedEvent> events;
  for (int k = 1; k <= Switched::kPassings; ++k) {
    const double t = Switched::Passing(TwoLink::Truth()[0], k) + trial.offset;
    events.push_back({"latch", "elbow", k, t + sigma * rng.Normal(), sigma});
  }
  data.others = {std::make_shared<TimedEvents>(std::move(events))};
  return data;
}

std::vector<TimedEvent> EventsOf(const Observations& data) {
  return dynamic_cast<const TimedEvents&>(*data.others.at(0)).events();
}

FitResult FitTo(const Observations& data, const Model& model) {
  return FitTwoLink(model, data, false);
}

// Few, poor marks and a good switch: the intervals are right, and the switch is what narrows them.
TEST(Events, NarrowTheErrorsByWhatTheyTell) {
  const int seeds = Repeats(30, 100);
  constexpr double kSwitch = 1e-4;  // [s]
  const Switched model;
  Trial trial = SparseTrial();
  trial.sigma = 1e-2;
  std::vector<FitResult> with(static_cast<std::size_t>(seeds)), without(with.size());
  ParallelFor(with.size(), 0, [&](std::size_t i) {
    Rng rng(9000 + i);
    Observations data = WithEvents(trial, kSwitch, rng);
    with[i] = FitTo(data, model);
    data.others.clear();
    without[i] = FitTo(data, model);
  });
  int covered = 0;
  std::vector<double> z, gain;
  for (std::size_t i = 0; i < with.size(); ++i) {
    ASSERT_TRUE(with[i].Usable() && without[i].Usable()) << with[i].message;
    const ParameterEstimate& e = with[i].parameters[0];
    z.push_back((e.value - TwoLink::Truth()[0]) / e.sigma);
    covered += std::abs(z.back()) < 1.959964 ? 1 : 0;
    gain.push_back(e.sigma / without[i].parameters[0].sigma);
  }
  const auto [low, high] = BinomialInterval(static_cast<std::size_t>(covered), with.size(), 0.999);
  EXPECT_LE(low, 0.95);
  EXPECT_GE(high, 0.95);
  EXPECT_NEAR(Variance(z), 1.0, 4.0 * std::sqrt(2.0 / seeds));
  EXPECT_LT(Median(gain), 0.8);
}

// The information of the switch by hand: times t_k = (k/2 - 1/4) / f + tau, the offset unknown.
TEST(Events, AddTheInformationOfTheirTimes) {
  constexpr double kSwitch = 1e-4;
  Trial trial = SparseTrial();
  Rng rng(4);
  Observations data = WithEvents(trial, kSwitch, rng);
  const Stamps stamps = data.StampsAt(trial.offset);
  const Switched model;
  const Prediction at = model.Evaluate(TwoLink::Truth(), stamps);
  constexpr double kStep = 1e-6;
  const std::vector<double> beside = {TwoLink::Truth()[0] + kStep, TwoLink::Truth()[1]};
  const Change change = Difference(data, at, model.Evaluate(beside, stamps), 1.0 / kStep);
  const Eigen::VectorXd column = data.others[0]->Response(change.others[0], {}, {});
  const double f = TwoLink::Truth()[0];
  for (int k = 1; k <= Switched::kPassings; ++k) {
    EXPECT_NEAR(column(k - 1), (0.5 * k - 0.25) / (f * f) / kSwitch, 1e-3 / kSwitch);
  }
  RegistrationOptions options;
  options.with_others = true;
  const RegistrationFit fit =
      FitRegistration(data, at, trial.offset, StartingFrame(data, at, trial.offset), options);
  options.with_others = false;
  const RegistrationFit plain =
      FitRegistration(data, at, trial.offset, StartingFrame(data, at, trial.offset), options);
  const double before = 1.0 / (plain.sigma(6) * plain.sigma(6));
  const double after = 1.0 / (fit.sigma(6) * fit.sigma(6));
  const double told = Switched::kPassings / (kSwitch * kSwitch);
  EXPECT_NEAR(after - before, told, 1e-6 * after);
}

TEST(Events, OneThatTheModelLacksPullsTowardsTheEndAndIsSaid) {
  Trial trial = SparseTrial();
  Rng rng(4);
  Observations data = WithEvents(trial, 1e-3, rng);
  std::vector<TimedEvent> one = {EventsOf(data)[0]};
  one[0].where = "nowhere";
  data.others = {std::make_shared<TimedEvents>(one)};
  const Switched model;
  const FitResult fit = FitTo(data, model);
  const Eigen::VectorXd times = data.others[0]->NumbersOf(fit.trials[0].prediction);
  ASSERT_EQ(times.size(), 1);
  EXPECT_TRUE(std::isnan(times(0)));
  const ResidualKind::Clocks clocks = {fit.trials[0].at.clock(), fit.trials[0].reference,
                                       data.Pivot(), data.End()};
  EXPECT_THAT(data.others[0]->Words(times, clocks, {}, "")[0],
              ::testing::EndsWith("the model has none."));
  EXPECT_GT(fit.cost, 1e5);  // a second or more, in milliseconds
}

TEST(Events, AHorizonAndAClockTakeThemAlong) {
  Trial trial = SparseTrial();
  Rng rng(4);
  const Observations data = WithEvents(trial, 1e-3, rng);
  const std::vector<TimedEvent> all = EventsOf(data);
  EXPECT_EQ(EventsOf(Cut(data, {0.0, all[1].t})).size(), 2u);
  EXPECT_TRUE(Cut(data, {0.0, 0.5 * all[0].t}).others.empty());
  const Observations slow = WithoutDrift(data, 1e-3, 1.0);
  EXPECT_NEAR(EventsOf(slow)[3].t, 1.0 + (all[3].t - 1.0) / 1.001, 1e-12);
}

}  // namespace
}  // namespace unfurl::correlate::events_test
