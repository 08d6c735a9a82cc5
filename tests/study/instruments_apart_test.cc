// An instrument that is not what the study says of it: beside an oscillator in closed form.
#include "study/instruments_apart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "base/random.h"
#include "correlate/residual/channel.h"

namespace unfurl::study::instruments_apart_test {
namespace {

using ::testing::HasSubstr;

constexpr double kPi = std::numbers::pi, kSigma = 2e-3;  // [-], of an angle [rad]
constexpr double kReleased = 0.6;                        // [rad]

// A damped oscillator released from rest; parameters: frequency [Hz], decay [1/s].
class Swing : public correlate::Model {
 public:
  static std::vector<double> Truth() { return {0.8, 0.12}; }
  static double Angle(std::span<const double> theta, double t) {
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    if (t < 0.0) return kReleased;
    return kReleased * std::exp(-d * t) * (std::cos(w * t) + d / w * std::sin(w * t));
  }
  static double Rate(std::span<const double> theta, double t) {
    const double w = 2.0 * kPi * theta[0], d = theta[1];
    return t < 0.0 ? 0.0 : -kReleased * std::exp(-d * t) * (w + d * d / w) * std::sin(w * t);
  }
  correlate::Prediction Evaluate(std::span<const double> theta,
                                 const correlate::Stamps& stamps) const override {
    correlate::Prediction out;
    for (const correlate::QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        const double t = q.t[static_cast<std::size_t>(i)];
        values(i) = q.quantity == "angle" ? Angle(theta, t) : Rate(theta, t);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    return out;
  }
};

// What is wrong of the encoder, or of the swing: what it lacks of the model's decay grows with its
// size.
struct Wrong {
  double gain = 1.0, bias = 0.0, delay = 0.0, law = 0.0;
};

TrialsApart Find(const Wrong& wrong, bool gyroscope) {
  static const Swing model;
  Rng rng(31);
  correlate::Observations o;
  o.placement.offset = correlate::Prior::Known(0.0);
  for (const char* name : {"angle", "rate"}) {
    const bool angle = name == std::string("angle");
    if (!angle && !gyroscope) continue;
    correlate::ChannelRecord c;
    c.name = c.quantity = name;
    c.unit = angle ? "rad" : "rad/s";
    std::vector<double> y;
    for (double t = -0.3; t < 6.0; t += 0.02) {
      c.t.push_back(t);
      const double there = angle ? t - wrong.delay : t;
      std::vector<double> theta = Swing::Truth();
      theta[1] += wrong.law * std::exp(-there);
      const double q =
          angle ? wrong.gain * Swing::Angle(theta, there) + wrong.bias : Swing::Rate(theta, there);
      y.push_back(q + kSigma * rng.Normal());
    }
    c.pivot = 0.5 * (c.t.front() + c.t.back());
    c.y = Eigen::Map<const Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size()));
    c.sigma = Eigen::VectorXd::Constant(c.y.size(), kSigma);
    o.others.push_back(std::make_shared<correlate::Channel>(std::move(c)));
  }
  correlate::FitProblem problem;
  problem.parameters.resize(2);
  correlate::Parameter &f = problem.parameters[0], &d = problem.parameters[1];
  f.name = "frequency", f.unit = "Hz", f.start = 0.82, f.low = 0.5, f.high = 1.2;
  d.name = "decay", d.unit = "1/s", d.start = 0.15, d.low = 0.01, d.high = 1.0, d.log = true;
  problem.trials.resize(1);
  problem.trials[0].name = "the trial";
  problem.trials[0].observations = &o;
  problem.trials[0].model = &model;
  correlate::FitOptions options;
  options.workers = 1;
  options.profile.wanted = false;
  options.search.screened = 0;
  return FindInstrumentsApart(problem, options, correlate::Fit(problem, options));
}

// The number that follows.
double After(const std::string& words, const std::string& what) {
  const std::size_t at = words.find(what);
  return at == std::string::npos ? std::nan("") : std::stod(words.substr(at + what.size()));
}

TEST(InstrumentsApart, NoneWhereAllIsExplained) {
  for (const bool gyroscope : {false, true}) {
    const TrialsApart apart = Find({}, gyroscope);
    EXPECT_EQ(apart.verdict, "");
    EXPECT_TRUE(apart.reasons.empty());
  }
}

// With the clock known a gain of 0.9 is no offset, and no damping.
TEST(InstrumentsApart, AGainBesideAKnownClock) {
  for (const bool gyroscope : {false, true}) {
    Wrong wrong;
    wrong.gain = 0.9;
    const TrialsApart apart = Find(wrong, gyroscope);
    EXPECT_EQ(apart.verdict, "the data with the gain of angle that the study says");
    ASSERT_EQ(apart.reasons.size(), 1U);
    // Four of its standard errors; and of the frequency's, of the encoder alone.
    EXPECT_NEAR(After(apart.reasons[0], "gain of angle of "), 0.9, 2e-3);
    EXPECT_NEAR(After(apart.reasons[0], "frequency "), 0.8, 1e-4);
    EXPECT_THAT(apart.reasons[0], HasSubstr("in place of 1 "));
    EXPECT_THAT(apart.reasons[0], HasSubstr("trial.channel.angle.gain"));
  }
}

TEST(InstrumentsApart, ABiasAndADelay) {
  Wrong bias, late;
  bias.bias = 0.02;
  late.delay = 0.01;
  EXPECT_EQ(Find(bias, true).verdict, "the data with the bias of angle that the study says");
  const TrialsApart apart = Find(late, true);
  // Either of two clocks that differ may be the wrong one.
  EXPECT_THAT(apart.verdict, HasSubstr("the delay of angle"));
  EXPECT_NEAR(After(apart.reasons.at(0), "delay of angle of "), 0.01, 4e-4);  // as above [s]
}

// Another law of damping is no instrument's.
TEST(InstrumentsApart, NoneWhereTheModelLacksALaw) {
  Wrong wrong;
  wrong.law = 0.05;
  const TrialsApart apart = Find(wrong, true);
  EXPECT_EQ(apart.verdict, "");
}

}  // namespace
}  // namespace unfurl::study::instruments_apart_test
