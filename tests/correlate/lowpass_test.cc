// The low passes of instruments against their transfer functions in closed form.
#include "correlate/residual/lowpass.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "base/error.h"

namespace unfurl::correlate::lowpass_test {
namespace {

constexpr double kPi = std::numbers::pi;

// Amplitude and phase that a filter gives to a sine, once it has forgotten the start.
std::complex<double> ResponseOf(const LowPass& filter, double frequency, double step) {
  const double settle = filter.Memory() * 3.0;
  const auto first = static_cast<Eigen::Index>(std::ceil(settle / step));
  const double periods = std::ceil(2.0 + 20.0 * step * frequency);
  const auto count = static_cast<Eigen::Index>(std::llround(periods / frequency / step));
  Eigen::VectorXd sine(first + count);
  for (Eigen::Index i = 0; i < sine.size(); ++i) {
    sine(i) = std::sin(2.0 * kPi * frequency * step * static_cast<double>(i));
  }
  const Eigen::VectorXd out = filter.Apply(sine, step);
  std::complex<double> sum = 0.0;
  for (Eigen::Index i = first; i < out.size(); ++i) {
    sum += out(i) * std::polar(1.0, -2.0 * kPi * frequency * step * static_cast<double>(i));
  }
  return sum * std::complex<double>(0.0, 2.0) / static_cast<double>(count);
}

LowPass Make(LowPass::Kind kind, int order, double cutoff) {
  LowPass out;
  out.kind = kind;
  out.order = order;
  out.cutoff = cutoff;
  return out;
}

// |H|^2 = 1 / (1 + (f/fc)^2n) [Butterworth 1930].
TEST(LowPass, ButterworthsAmplitude) {
  for (int order : {1, 2, 3, 4, 8}) {
    const LowPass filter = Make(LowPass::Kind::kButterworth, order, 50.0);
    for (double f : {5.0, 25.0, 50.0, 100.0}) {
      const double expected = 1.0 / std::sqrt(1.0 + std::pow(f / 50.0, 2 * order));
      EXPECT_NEAR(std::abs(ResponseOf(filter, f, 1e-5)), expected, 2e-5) << order << " at " << f;
    }
  }
}

// The Bessel filter of order 3 in closed form, 15 / (s^3 + 6 s^2 + 15 s + 15), its delay flat at
// low frequencies, its amplitude 1/sqrt(2) at the cutoff, whatever the order.
TEST(LowPass, BesselsAmplitudeAndDelay) {
  for (int order : {1, 2, 3, 5, 10}) {
    const LowPass filter = Make(LowPass::Kind::kBessel, order, 40.0);
    EXPECT_NEAR(std::abs(ResponseOf(filter, 40.0, 1e-5)), std::sqrt(0.5), 2e-5) << order;
  }
  const LowPass third = Make(LowPass::Kind::kBessel, 3, 40.0);
  constexpr double kCutoff = 1.7556723;  // of the polynomial as it stands [rad/s]
  for (double f : {4.0, 20.0, 60.0}) {
    const std::complex<double> s(0.0, f / 40.0 * kCutoff);
    const std::complex<double> expected = 15.0 / (s * s * s + 6.0 * s * s + 15.0 * s + 15.0);
    EXPECT_LT(std::abs(ResponseOf(third, f, 1e-5) - expected), 1e-4) << f;
  }
}

// sin(pi f T) / (pi f T), late by half the width; also where the width is no multiple of the step.
TEST(LowPass, AnAverageIsASinc) {
  LowPass filter;
  filter.kind = LowPass::Kind::kAverage;
  filter.width = 0.0123;
  for (double f : {3.0, 30.0, 100.0}) {
    const double x = kPi * f * filter.width;
    const std::complex<double> expected = std::sin(x) / x * std::polar(1.0, -x);
    EXPECT_LT(std::abs(ResponseOf(filter, f, 2e-5) - expected), 5e-5) << f;
  }
}

TEST(LowPass, WhatStandsStillPassesAsItIs) {
  const Eigen::VectorXd still = Eigen::VectorXd::Constant(500, 3.25);
  LowPass average;
  average.kind = LowPass::Kind::kAverage;
  average.width = 0.05;
  for (const LowPass& filter : {LowPass(), Make(LowPass::Kind::kButterworth, 4, 10.0),
                                Make(LowPass::Kind::kBessel, 6, 10.0), average}) {
    EXPECT_LT((filter.Apply(still, 1e-3) - still).cwiseAbs().maxCoeff(), 1e-10);
  }
}

// A step, of order 1: 1 - exp(-w t), to round-off, since it is linear between the points.
TEST(LowPass, AStepOfAnRcElement) {
  Eigen::VectorXd step = Eigen::VectorXd::Ones(400);
  step(0) = 0.0;  // a ramp over the first interval
  const double h = 1e-3, w = 2.0 * kPi * 7.0;
  const Eigen::VectorXd out = Make(LowPass::Kind::kButterworth, 1, 7.0).Apply(step, h);
  for (int i : {1, 10, 399}) {
    const double t = i * h;
    const double ramp = 1.0 - (std::exp(-w * (t - h)) - std::exp(-w * t)) / (w * h);
    EXPECT_NEAR(out(i), ramp, 1e-12);
  }
}

TEST(LowPass, BadFiltersAreNamed) {
  EXPECT_THROW(Make(LowPass::Kind::kButterworth, 0, 10.0).Check(), Error);
  EXPECT_THROW(Make(LowPass::Kind::kBessel, 11, 10.0).Check(), Error);
  EXPECT_THROW(Make(LowPass::Kind::kBessel, 4, -1.0).Check(), Error);
  LowPass average;
  average.kind = LowPass::Kind::kAverage;
  EXPECT_THROW(average.Check(), Error);
  EXPECT_NO_THROW(LowPass().Check());
}

}  // namespace
}  // namespace unfurl::correlate::lowpass_test
