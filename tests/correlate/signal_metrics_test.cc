#include "correlate/compare/signal_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/error.h"

namespace unfurl::correlate::signal_metrics_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRoundOff = 1e-12;  // issue: published formulas and closed forms to 1e-12

struct Signals {
  std::vector<double> t, test, computed, sigma;
  SignalPair pair() const { return {t, test, computed, sigma}; }
};

// Whole periods of a sine against another's multiple, behind in phase: all integrals are known.
Signals Sines(double factor, double behind, std::size_t n = 2000) {
  Signals s;
  for (std::size_t i = 0; i <= n; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(n);
    s.t.push_back(t);
    s.test.push_back(0.2 * std::sin(2 * kPi * 3 * t));
    s.computed.push_back(0.2 * factor * std::sin(2 * kPi * 3 * t - behind));
  }
  return s;
}

SignalScore Score(const Signals& s) {
  const SignalPair pair = s.pair();
  return ScoreSignals(std::span(&pair, 1));
}

TEST(SignalScore, SpragueGeersOfSinesInClosedForm) {
  const SignalScore s = Score(Sines(1.3, 0.4));
  EXPECT_NEAR(s.sprague_geers_magnitude, 0.3, kRoundOff);
  EXPECT_NEAR(s.sprague_geers_phase, 0.4 / kPi, kRoundOff);
  EXPECT_NEAR(s.sprague_geers, std::hypot(0.3, 0.4 / kPi), kRoundOff);
  // Schwer's check of the formula [Schwer 2007]: 20% too large in amplitude alone is M = 0.2, P =
  // 0.
  const SignalScore large = Score(Sines(1.2, 0.0));
  EXPECT_NEAR(large.sprague_geers_magnitude, 0.2, kRoundOff);
  EXPECT_NEAR(large.sprague_geers_phase, 0.0, 1e-7);  // acos near 1 has half the digits
}

TEST(SignalScore, RussellOfSinesInClosedForm) {
  const double f = 0.7;
  const SignalScore s = Score(Sines(f, 1.1));
  const double r = (f * f - 1.0) / f;
  const double magnitude = -std::log10(1.0 - r);  // r < 0: computed has less energy
  EXPECT_NEAR(s.russell_magnitude, magnitude, kRoundOff);
  EXPECT_NEAR(s.russell_phase, 1.1 / kPi, kRoundOff);
  EXPECT_NEAR(s.russell, std::sqrt(kPi / 4 * (magnitude * magnitude + 1.1 * 1.1 / (kPi * kPi))),
              kRoundOff);
  // Russell's measure is symmetric in who is larger, Sprague and Geers' is not.
  EXPECT_NEAR(Score(Sines(1.0 / f, 1.1)).russell_magnitude, -magnitude, kRoundOff);
}

TEST(SignalScore, AConstantApart) {
  Signals s = Sines(1.0, 0.0);
  for (double& c : s.computed) c += 0.05;
  s.sigma.assign(s.t.size(), 0.01);
  const SignalScore score = Score(s);
  EXPECT_NEAR(score.rmse, 0.05, kRoundOff);
  EXPECT_NEAR(score.largest, 0.05, kRoundOff);
  EXPECT_NEAR(score.sigmas, 5.0, 1e-10);
  double squares = 0.0;  // the sine's mean is zero; the end point counts twice in its squares: 0
  for (const double m : s.test) squares += m * m;
  EXPECT_NEAR(score.r2, 1.0 - 0.05 * 0.05 * static_cast<double>(s.t.size()) / squares, kRoundOff);
  // 2000 / 3 samples a period: the extremes lie between stamps by less than a quarter step.
  EXPECT_NEAR(score.range, 0.4, 1e-6);
  EXPECT_NEAR(score.nrmse, 0.05 / score.range, kRoundOff);
}

TEST(SignalScore, TheMeanPredictsNothing) {
  Signals s = Sines(1.0, 0.0);
  s.computed.assign(s.t.size(), 0.0);
  EXPECT_NEAR(Score(s).r2, 0.0, 1e-10);
}

TEST(SignalScore, ComponentsOfAVectorAddUp) {
  // On a circle the distance between two points a quarter turn apart is sqrt(2) radii.
  Signals x, y;
  for (int i = 0; i <= 400; ++i) {
    const double a = 2 * kPi * i / 400.0;
    for (Signals* s : {&x, &y}) s->t.push_back(i * 0.01);
    x.test.push_back(3.0 * std::cos(a));
    y.test.push_back(3.0 * std::sin(a));
    x.computed.push_back(-3.0 * std::sin(a));
    y.computed.push_back(3.0 * std::cos(a));
  }
  const std::vector<SignalPair> both = {x.pair(), y.pair()};
  const SignalScore s = ScoreSignals(both);
  EXPECT_NEAR(s.rmse, 3.0 * std::numbers::sqrt2, kRoundOff);
  EXPECT_NEAR(s.largest, 3.0 * std::numbers::sqrt2, kRoundOff);
  EXPECT_NEAR(s.range, 6.0 * std::numbers::sqrt2, kRoundOff);
  EXPECT_NEAR(s.sprague_geers_magnitude, 0.0, kRoundOff);
  EXPECT_NEAR(s.sprague_geers_phase, 0.5, kRoundOff);
}

TEST(SignalScore, AGapIsNotIntegratedOver) {
  std::vector<double> t;
  for (int i = 0; i < 11; ++i) t.push_back(0.1 * i);
  for (int i = 0; i < 11; ++i) t.push_back(5.0 + 0.1 * i);
  double sum = 0.0;
  for (const double w : IntegralWeights(t)) sum += w;
  EXPECT_NEAR(sum, 2.0, kRoundOff);
}

TEST(SignalScore, UnevenStampsAreWeighedByTheirSteps) {
  // The integral of t^2 over [0, 1] by the trapezoid rule on a graded grid, against its own
  // formula.
  Signals s;
  double rule = 0.0;
  for (int i = 0; i <= 100; ++i) s.t.push_back(0.5 * (i / 100.0 + std::pow(i / 100.0, 2)));
  for (const double t : s.t) s.test.push_back(t), s.computed.push_back(2.0 * t);
  for (std::size_t i = 0; i + 1 < s.t.size(); ++i) {
    rule += 0.5 * (s.t[i + 1] - s.t[i]) * (s.t[i] * s.t[i] + s.t[i + 1] * s.t[i + 1]);
  }
  const std::vector<double> w = IntegralWeights(s.t);
  double sum = 0.0;
  for (std::size_t i = 0; i < w.size(); ++i) sum += w[i] * s.t[i] * s.t[i];
  EXPECT_NEAR(sum, rule, kRoundOff);
  EXPECT_NEAR(Score(s).sprague_geers_magnitude, 1.0, kRoundOff);
}

TEST(SignalScore, DifferentLengthsAreRefused) {
  Signals s = Sines(1.0, 0.0);
  s.computed.pop_back();
  EXPECT_THROW(Score(s), Error);
}

}  // namespace
}  // namespace unfurl::correlate::signal_metrics_test
