#include "correlate/hierarchy/random_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

constexpr double kTail = 0.025;   // on each side of 95%
constexpr double kLeast = 1e-12;  // of a variance, so that identical values leave one [-]

}  // namespace

ScatterLevels::ScatterLevels(Eigen::Index trials_) : trials(trials_) {
  if (trials < 2) {
    throw Error(fmt::format("the scatter of {} trials", trials), "trials", "give at least two");
  }
  const double freedom = static_cast<double>(trials - 1);
  // Middle points of v, where v^2 is the probability: dense where Q is small and tau large, which
  // is where the tails of what follows come from. Quantiles move by less than a thousandth with
  // twice as many.
  constexpr Eigen::Index kPoints = 120;
  q.resize(kPoints);
  weight.resize(kPoints);
  for (Eigen::Index k = 0; k < kPoints; ++k) {
    const double v = 1.0 - (static_cast<double>(k) + 0.5) / static_cast<double>(kPoints);
    q(k) = ChiSquareQuantile(v * v, freedom);
    weight(k) = 2.0 * v / static_cast<double>(kPoints);
  }
  low = ChiSquareQuantile(kTail, freedom);
  high = ChiSquareQuantile(1.0 - kTail, freedom);
}

RandomEffect::RandomEffect(Eigen::VectorXd value, Eigen::VectorXd variance, double shared,
                           const ScatterLevels& levels)
    : value_(std::move(value)), variance_(std::move(variance)), shared_(shared), levels_(levels) {
  if (value_.size() != levels_.trials || variance_.size() != levels_.trials) {
    throw Error(fmt::format("{} values and {} variances of {} trials", value_.size(),
                            variance_.size(), levels_.trials),
                "trials", "give one of each a trial");
  }
  if (!value_.allFinite() || !variance_.allFinite() || !(variance_.minCoeff() > 0.0) ||
      !(shared_ >= 0.0) || !std::isfinite(shared_)) {
    throw Error("a trial's value or variance is not finite, or a variance not positive", "trials",
                "leave the trial out");
  }
  q0_ = Q(0.0);
  const auto count = levels_.q.size();
  tau2_.resize(count);
  center_.resize(count);
  center_variance_.resize(count);
  double from = 0.0;
  for (Eigen::Index k = 0; k < count; ++k) {
    from = ScatterAt(levels_.q(k), from);
    tau2_(k) = from;
    center_(k) = WeightedMean(from, &center_variance_(k));
    // Student's density where tau is 0. Identical values would leave none: not less than rounding.
    center_variance_(k) *= std::clamp(q0_ / levels_.q(k), kLeast, 1.0);
  }
  const double tau2 = ScatterAt(static_cast<double>(trials() - 1), 0.0);
  scatter_ = std::sqrt(tau2);
  double unused = 0.0;
  mean_ = WeightedMean(tau2, &unused);
}

double RandomEffect::WeightedMean(double tau2, double* variance) const {
  const Eigen::ArrayXd weight = (variance_.array() + tau2).inverse();
  *variance = 1.0 / weight.sum();
  return (weight * value_.array()).sum() * *variance;
}

double RandomEffect::Q(double tau2) const {
  double unused = 0.0;
  const double mean = WeightedMean(tau2, &unused);
  return ((value_.array() - mean).square() / (variance_.array() + tau2)).sum();
}

double RandomEffect::ScatterAt(double q, double from) const {
  // Q falls with tau^2 and is convex, so that Newton's steps from the left stay left of the root
  // [DerSimonian and Kacker 2007].
  double tau2 = from;
  constexpr int kMost = 200;        // a step doubles tau^2 at least where it is far off
  constexpr double kClose = 1e-12;  // relative [-]
  for (int i = 0; i < kMost; ++i) {
    double unused = 0.0;
    const double mean = WeightedMean(tau2, &unused);
    const Eigen::ArrayXd total = variance_.array() + tau2;
    const Eigen::ArrayXd squares = (value_.array() - mean).square() / total;
    const double excess = squares.sum() - q;
    if (excess <= 0.0) break;
    const double step = excess / (squares / total).sum();
    tau2 += step;
    if (step <= kClose * tau2) break;
  }
  return tau2;
}

double RandomEffect::AlikeP() const {
  return ChiSquareTail(q0_, static_cast<double>(trials() - 1));
}

Interval RandomEffect::Scatter95() const {
  const double low = ScatterAt(levels_.high, 0.0);
  return {std::sqrt(low), std::sqrt(ScatterAt(levels_.low, low))};
}

bool RandomEffect::TooAlike() const { return q0_ < levels_.low; }

double RandomEffect::Visible() const {
  // E[Q(0)] = N - 1 + tau^2 (S1 - S2 / S1), S1 and S2 the sums of the weights and of their squares
  // [DerSimonian and Laird 1986].
  const Eigen::ArrayXd weight = variance_.array().inverse();
  const double s1 = weight.sum(), s2 = weight.square().sum();
  return std::sqrt((levels_.high - static_cast<double>(trials() - 1)) / (s1 - s2 / s1));
}

NormalMixture RandomEffect::Mean() const {
  return {levels_.weight, center_, center_variance_.array() + shared_};
}

NormalMixture RandomEffect::NextEstimate(double variance) const {
  return {levels_.weight, center_, center_variance_ + (tau2_.array() + variance).matrix()};
}

NormalMixture RandomEffect::Next() const { return NextEstimate(shared_); }

NormalMixture RandomEffect::Effect(Eigen::Index i) const {
  NormalMixture out{levels_.weight, center_, center_variance_};
  const double own = variance_(i);
  for (Eigen::Index k = 0; k < tau2_.size(); ++k) {
    // Normal prior and datum; the mean's own error enters by the part that the prior has.
    const double kept = tau2_(k) / (tau2_(k) + own);
    out.mean(k) = center_(k) + kept * (value_(i) - center_(k));
    out.variance(k) = kept * own + (1.0 - kept) * (1.0 - kept) * center_variance_(k);
  }
  return out;
}

std::vector<LeftOut> LeaveOneOut(const Eigen::VectorXd& value, const Eigen::VectorXd& variance) {
  const Eigen::Index n = value.size();
  if (n < 3) {
    throw Error(fmt::format("{} trials, one of them left out", n), "trials", "give at least three");
  }
  const ScatterLevels levels(n - 1);
  std::vector<LeftOut> out;
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::VectorXd others(n - 1), their(n - 1);
    others << value.head(i), value.tail(n - 1 - i);
    their << variance.head(i), variance.tail(n - 1 - i);
    const NormalMixture next = RandomEffect(others, their, 0.0, levels).NextEstimate(variance(i));
    const double below = next.Cdf(value(i));
    out.push_back({next.LogDensity(value(i)), 2.0 * std::min(below, 1.0 - below)});
  }
  return out;
}

}  // namespace unfurl::correlate
