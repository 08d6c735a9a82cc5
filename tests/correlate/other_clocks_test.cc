// Records of a motion that repeats itself, and which of its swings they begin with.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "base/random.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"

namespace unfurl::correlate::other_clocks_test {
namespace {

using ::testing::Contains;
using ::testing::Not;

constexpr double kPi = std::numbers::pi;
constexpr double kFrequency = 0.6, kDecay = 0.03, kAmplitude = 0.6;  // [Hz], [1/s], [rad]
constexpr double kPeriod = 1.0 / kFrequency;

// What a channel of the angle reads.
void AddAngles(const std::function<double(double t)>& angle, const Stamps& stamps,
               Prediction* out) {
  for (const QuantityStamps& q : stamps.quantities) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      values(i) = angle(q.t[static_cast<std::size_t>(i)]);
    }
    out->quantities.push_back({q.key, std::move(values)});
  }
}

// A damped linear oscillator released from rest, in closed form, and a bob on an arm of 1 m.
// Parameters: frequency [Hz], decay [1/s] and what it is released from [rad].
class Oscillator : public Model {
 public:
  static double Angle(std::span<const double> theta, double t) {
    if (t <= 0.0) return theta[2];
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    return theta[2] * std::exp(-d * t) * (std::cos(w * t) + d / w * std::sin(w * t));
  }
  static double Rate(std::span<const double> theta, double t) {
    if (t <= 0.0) return 0.0;
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    return -theta[2] * std::exp(-d * t) * (w + d * d / w) * std::sin(w * t);
  }

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    for (const std::vector<double>& times : stamps.t) {
      MarkMotion motion;
      motion.p.setZero(3, static_cast<Eigen::Index>(times.size()));
      motion.v = motion.p;
      for (Eigen::Index i = 0; i < motion.p.cols(); ++i) {
        const double t = times[static_cast<std::size_t>(i)];
        const double q = Angle(theta, t), rate = Rate(theta, t);
        motion.p.col(i) << std::sin(q), -std::cos(q), 0.0;
        motion.v.col(i) << rate * std::cos(q), rate * std::sin(q), 0.0;
      }
      out.marks.push_back(std::move(motion));
    }
    AddAngles([&](double t) { return Angle(theta, t); }, stamps, &out);
    return out;
  }
};

// Recorded from `from` to `to` after the release, by a clock that shows 0 when the record begins.
struct Recorded {
  double from = 0.0, to = 9.0, step = 0.01;  // [s]
  double sigma = 0.002;                      // [rad], [m]
  bool marks = false, states_sigma = true;
};

Observations Record(const Recorded& r, std::uint64_t seed) {
  Rng rng(seed);
  const std::vector<double> truth = {kFrequency, kDecay, kAmplitude};
  std::vector<double> t;
  for (double s = 0.0; s <= r.to - r.from; s += r.step) t.push_back(s);
  const auto n = static_cast<Eigen::Index>(t.size());
  Observations out;
  if (r.marks) {
    MarkSeries bob;
    bob.name = "bob";
    bob.t = t;
    bob.p.resize(3, n);
    bob.cov.resize(6, n);
    bob.shared.resize(3, 0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double q = Oscillator::Angle(truth, t[static_cast<std::size_t>(i)] + r.from);
      bob.p.col(i) << std::sin(q), -std::cos(q), 0.0;
      for (double& x : bob.p.col(i)) x += r.sigma * rng.Normal();
      const double v = r.sigma * r.sigma;
      bob.cov.col(i) << v, 0.0, 0.0, v, 0.0, v;
    }
    out.marks.push_back(std::move(bob));
    out.placement.frame.kind = Foreknowledge::kKnown;
    return out;
  }
  ChannelRecord c;
  c.name = c.quantity = "angle";
  c.unit = "rad";
  c.t = t;
  c.y.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    c.y(i) =
        Oscillator::Angle(truth, t[static_cast<std::size_t>(i)] + r.from) + r.sigma * rng.Normal();
  }
  if (r.states_sigma) c.sigma = Eigen::VectorXd::Constant(n, r.sigma);
  out.others = {std::make_shared<Channel>(std::move(c))};
  return out;
}

Parameter Named(const char* name, double start, double low, double high) {
  Parameter p;
  p.name = name, p.unit = "1", p.start = start, p.low = low, p.high = high;
  return p;
}

// The amplitude is known where `amplitude` is not free.
FitResult FitTo(const Observations& data, double frequency, bool amplitude) {
  static const Oscillator model;
  FitProblem problem;
  const double room = amplitude ? 0.5 : 1e-9;
  problem.parameters = {Named("frequency", frequency, 0.4, 0.9), Named("decay", 0.05, 0.0, 0.2),
                        Named("amplitude", kAmplitude - (amplitude ? 0.05 : 0.0), kAmplitude - room,
                              kAmplitude + room)};
  FitTrial trial;
  trial.observations = &data;
  trial.model = &model;
  problem.trials = {trial};
  FitOptions options;
  if (!amplitude) options.free = {{"frequency", "decay"}};
  return Fit(problem, options);
}

bool Holds(const Interval& interval, double value) {
  return !(value < interval.low) && !(value > interval.high);  // an open side is NaN
}

// The record begins after the release, at an unknown time, and what the arm was released from is
// unknown: released a period earlier from exp(decay period) times as far it would have done the
// same. Nothing may claim to know either; frequency and decay are known all the same.
TEST(OtherClocks, WhatTheReleaseWasIsNotKnownWhereItIsNotShown) {
  for (const bool marks : {false, true}) {
    for (const bool states_sigma : {true, false}) {
      if (marks && !states_sigma) continue;
      Recorded how;
      how.from = 2.3, how.to = 11.3, how.marks = marks, how.states_sigma = states_sigma;
      const FitResult fit = FitTo(Record(how, 3), 0.59, true);
      ASSERT_TRUE(fit.Usable()) << fit.message;
      EXPECT_EQ(fit.parameters[0].verdict, Verdict::kDetermined);
      EXPECT_EQ(fit.parameters[1].verdict, Verdict::kDetermined);
      const ParameterEstimate& released = fit.parameters[2];
      EXPECT_EQ(released.verdict, Verdict::kCombination);
      EXPECT_THAT(released.with, Contains("time offset"));
      EXPECT_TRUE(Holds(released.all95, kAmplitude)) << released.value;
      ASSERT_FALSE(fit.other_clocks.empty());
      const OtherClock& other = fit.other_clocks.front();
      const double periods = (fit.trials[0].at.offset - other.offset[0]) / kPeriod;
      EXPECT_NEAR(periods, std::round(periods), 0.01);
      const double ratio = std::exp(kDecay * kPeriod * std::round(periods));
      EXPECT_NEAR(other.theta[2] / released.value, ratio, 0.01 * ratio);
    }
  }
}

// Where it is known what the arm was released from, only one offset explains the data, and it is
// found though at the start's values another one looks more alike.
TEST(OtherClocks, ALowerOffsetIsFound) {
  for (const bool states_sigma : {true, false}) {
    Recorded how;
    how.from = 2.3, how.to = 11.3, how.states_sigma = states_sigma;
    const FitResult fit = FitTo(Record(how, 4), 0.585, false);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    EXPECT_NEAR(fit.trials[0].at.offset, -how.from, 0.05 * kPeriod);
    EXPECT_EQ(fit.trials[0].goodness.outcome, Explained::kYes);
    EXPECT_LT(std::abs(fit.parameters[1].value - kDecay), 4.0 * fit.parameters[1].sigma);
    EXPECT_TRUE(fit.other_clocks.empty());
  }
}

// A record that shows the release leaves nothing open.
TEST(OtherClocks, NoneWhereTheReleaseIsShown) {
  Recorded how;
  how.from = -0.4;
  const FitResult fit = FitTo(Record(how, 5), 0.59, true);
  ASSERT_TRUE(fit.Usable()) << fit.message;
  EXPECT_TRUE(fit.other_clocks.empty());
  for (const ParameterEstimate& e : fit.parameters) {
    EXPECT_EQ(e.verdict, Verdict::kDetermined);
    EXPECT_THAT(e.with, Not(Contains("time offset")));
  }
  EXPECT_LT(std::abs(fit.parameters[2].value - kAmplitude), 4.0 * fit.parameters[2].sigma);
}

// Where no sigma is stated, any minimum's residuals look like noise of their size: from far starts
// the fit must come to the noise, and to the errors, that it has from a near one, which are those
// of the sigma stated.
TEST(OtherClocks, ErrorsAreNotThoseOfAWrongMinimum) {
  Recorded how;
  how.from = -0.4;
  const FitResult stated = FitTo(Record(how, 6), 0.6, true);
  how.states_sigma = false;
  Observations data = Record(how, 6);
  data.placement.offset = Prior::Known(0.4);
  for (const double start : {0.6, 0.45, 0.5, 0.68, 0.75, 0.85}) {
    const FitResult fit = FitTo(data, start, false);
    ASSERT_TRUE(fit.Usable()) << fit.message;
    const ParameterEstimate& e = fit.parameters[0];
    EXPECT_LT(std::abs(e.value - kFrequency), 4.0 * e.sigma) << start;
    // The clock and the amplitude are known here: the error is less, by no more than half.
    EXPECT_LT(e.sigma, 1.2 * stated.parameters[0].sigma) << start;
    EXPECT_GT(e.sigma, 0.5 * stated.parameters[0].sigma) << start;
    EXPECT_EQ(fit.trials[0].goodness.outcome, Explained::kYes) << start;
  }
}

// A pendulum, whose period grows with its swing, to first order [Lindstedt], seen by an instrument
// of unknown gain: its swings differ by little more than their size, and each hides in the gain,
// its sign included. Parameters: frequency [Hz] and decay [1/s].
class WideSwings : public Model {
 public:
  static double Angle(std::span<const double> theta, double t) {
    const double d = theta[1], e = std::exp(-d * std::max(t, 0.0));
    const double slower = kWide * kWide / (32.0 * d) * (1.0 - e * e);
    return kWide * e * std::cos(2.0 * kPi * theta[0] * (std::max(t, 0.0) - slower));
  }

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out;
    AddAngles([&](double t) { return Angle(theta, t); }, stamps, &out);
    return out;
  }

 private:
  static constexpr double kWide = 1.2;  // [rad]
};

// The frequency starts some percent off, so that over seven swings an alignment at the start's
// values is wrong by several: the way back goes on for as long as each swing explains the data
// better. Half-way it is as white, and a frequency there was called determined, fifty of its errors
// off.
TEST(OtherClocks, AreFollowedForAsLongAsTheyExplainTheDataBetter) {
  const WideSwings model;
  const std::vector<double> truth = {kFrequency, kDecay};
  for (const double start : {0.56, 0.575, 0.585, 0.61}) {
    Rng rng(7);
    ChannelRecord c;
    c.name = c.quantity = "angle";
    c.unit = "V";
    std::vector<double> y;
    for (double t = 0.0; t < 12.0; t += 0.01) {
      c.t.push_back(t);
      y.push_back(0.97 * WideSwings::Angle(truth, t) + 0.004 * rng.Normal());
    }
    c.y = Eigen::Map<const Eigen::VectorXd>(y.data(), std::ssize(y));
    c.gain = Prior::Free();
    Observations data;
    data.others = {std::make_shared<Channel>(std::move(c))};
    FitProblem problem;
    problem.parameters = {Named("frequency", start, 0.4, 0.9), Named("decay", 0.05, 0.001, 0.2)};
    FitTrial trial;
    trial.observations = &data;
    trial.model = &model;
    problem.trials = {trial};
    FitOptions options;
    options.profile.wanted = false;
    const FitResult fit = Fit(problem, options);
    ASSERT_TRUE(fit.Usable()) << start << ": " << fit.message;
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      EXPECT_NEAR(e.value, truth[j], 4.0 * e.sigma) << start << " " << e.sigma;
    }
    EXPECT_NEAR(fit.trials[0].registration.at.offset, 0.0, 0.1 * kPeriod) << start;
    for (const OtherClock& other : fit.other_clocks) {
      EXPECT_GT(std::abs(other.offset[0] - fit.trials[0].registration.at.offset), 0.1 * kPeriod)
          << "the same place beside itself";
    }
  }
}

}  // namespace
}  // namespace unfurl::correlate::other_clocks_test
