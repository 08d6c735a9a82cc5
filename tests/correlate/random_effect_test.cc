#include "correlate/hierarchy/random_effect.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "base/statistics.h"
#include "tests/correlate/campaigns.h"

namespace unfurl::correlate::random_effect_test {
namespace {

RandomEffect EffectOf(const Eigen::VectorXd& value, const Eigen::VectorXd& variance,
                      double shared = 0.0) {
  return {value, variance, shared, ScatterLevels(value.size())};
}

double SumOfSquares(const Eigen::VectorXd& v) { return (v.array() - v.mean()).square().sum(); }

// Eight values with an estimate's own error of 0.5.
const Eigen::VectorXd& Eight() {
  static const Eigen::VectorXd kValues =
      (Eigen::VectorXd(8) << 1.2, 3.1, -0.4, 2.2, 5.0, 1.9, 2.6, 0.3).finished();
  return kValues;
}

// Thirteen trials of a vaccine, logarithms of the ratios of risks (Colditz et al. 1994): the
// standard example of random effects. Q and the Q-profile interval of tau^2 as printed by
// Viechtbauer, Journal of Statistical Software 36 (2010).
TEST(RandomEffect, GivesThePublishedScatterOfThirteenTrials) {
  const std::vector<std::array<double, 4>> cases = {
      {4, 119, 11, 128},       {6, 300, 29, 274},        {3, 228, 11, 209},
      {62, 13536, 248, 12619}, {33, 5036, 47, 5761},     {180, 1361, 372, 1079},
      {8, 2537, 10, 619},      {505, 87886, 499, 87892}, {29, 7470, 45, 7232},
      {17, 1699, 65, 1600},    {186, 50448, 141, 27197}, {5, 2493, 3, 2338},
      {27, 16886, 29, 17825}};
  Eigen::VectorXd y(13), v(13);
  for (Eigen::Index i = 0; i < 13; ++i) {
    const auto [a, b, c, d] = cases[static_cast<std::size_t>(i)];
    y(i) = std::log(a / (a + b)) - std::log(c / (c + d));
    v(i) = 1.0 / a - 1.0 / (a + b) + 1.0 / c - 1.0 / (c + d);
  }
  const RandomEffect effect = EffectOf(y, v);
  EXPECT_NEAR(effect.Q(0.0), 152.2330, 5e-5);  // half of the last digit printed
  const Interval tau = effect.Scatter95();
  EXPECT_NEAR(tau.low * tau.low, 0.1197, 5e-5);
  EXPECT_NEAR(tau.high * tau.high, 1.1115, 5e-5);
  EXPECT_NEAR(effect.Q(effect.Scatter() * effect.Scatter()), 12.0, 1e-9);
  EXPECT_LT(effect.AlikeP(), 1e-20);
  EXPECT_FALSE(effect.TooAlike());
}

TEST(RandomEffect, IsStudentsWithEqualErrors) {
  const double own = 0.5, n = 8.0, squares = SumOfSquares(Eight());
  const RandomEffect effect = EffectOf(Eight(), Eigen::VectorXd::Constant(8, own * own));
  const Interval mean = effect.Mean().Middle95();
  const double half = StudentQuantile(0.975, n - 1) * std::sqrt(squares / (n - 1) / n);
  const double close = 2e-3 * half;  // of the levels' sum
  EXPECT_NEAR(effect.Value(), Eight().mean(), 1e-12);
  EXPECT_NEAR(mean.low, Eight().mean() - half, close);
  EXPECT_NEAR(mean.high, Eight().mean() + half, close);
  const Interval tau = effect.Scatter95();
  EXPECT_NEAR(tau.low * tau.low, squares / ChiSquareQuantile(0.975, n - 1) - own * own, 1e-10);
  EXPECT_NEAR(tau.high * tau.high, squares / ChiSquareQuantile(0.025, n - 1) - own * own, 1e-10);
  EXPECT_NEAR(effect.Scatter() * effect.Scatter(), squares / (n - 1) - own * own, 1e-10);
  EXPECT_NEAR(effect.Q(0.0), squares / (own * own), 1e-10);
}

// The mean's interval stays Student's where the trials show no scatter.
TEST(RandomEffect, IsStudentsWithoutScatter) {
  const double own = 2.5;  // above the values' own scatter of 1.7
  const RandomEffect effect = EffectOf(Eight(), Eigen::VectorXd::Constant(8, own * own));
  ASSERT_FALSE(effect.TooAlike());
  EXPECT_EQ(effect.Scatter(), 0.0);
  EXPECT_EQ(effect.Scatter95().low, 0.0);
  const Interval mean = effect.Mean().Middle95();
  const double half = StudentQuantile(0.975, 7) * std::sqrt(SumOfSquares(Eight()) / 7 / 8);
  EXPECT_NEAR(mean.high - mean.low, 2.0 * half, 4e-3 * half);
}

// Trials without error of their own: the next one's interval, and each by the others, are those of
// a sample of a normal density.
TEST(RandomEffect, ExpectsTheNextAsOfASample) {
  for (const Eigen::Index n : {3, 5, 8}) {
    const Eigen::VectorXd y = Eight().head(n), tiny = Eigen::VectorXd::Constant(n, 1e-12);
    const auto freedom = static_cast<double>(n - 1);
    const double s = std::sqrt(SumOfSquares(y) / freedom);
    const double half =
        StudentQuantile(0.975, freedom) * s * std::sqrt(1.0 + 1.0 / static_cast<double>(n));
    const Interval next = EffectOf(y, tiny).Next().Middle95();
    EXPECT_NEAR(next.low, y.mean() - half, 5e-3 * half) << n;
    EXPECT_NEAR(next.high, y.mean() + half, 5e-3 * half) << n;
  }
  // Where the eighth would be at the limit, p is 5%.
  Eigen::VectorXd y = Eight();
  const Eigen::VectorXd others = y.head(7);
  const double s = std::sqrt(SumOfSquares(others) / 6);
  y(7) = others.mean() + StudentQuantile(0.975, 6) * s * std::sqrt(1.0 + 1.0 / 7.0);
  const auto left = LeaveOneOut(y, Eigen::VectorXd::Constant(8, 1e-12));
  ASSERT_EQ(left.size(), 8u);
  EXPECT_NEAR(left[7].p, 0.05, 5e-4);
}

TEST(RandomEffect, FollowsUnitAndOrigin) {
  const Eigen::VectorXd v = (Eigen::VectorXd(8) << 1, 2, 0.3, 0.5, 4, 1, 0.2, 0.8).finished();
  const double factor = 2.5e-7, origin = 3e-6;
  const RandomEffect a = EffectOf(Eight(), v, 0.1);
  const RandomEffect b =
      EffectOf((factor * Eight()).array() + origin, factor * factor * v, factor * factor * 0.1);
  const auto close = 1e-8 * factor;
  EXPECT_NEAR(b.Value(), factor * a.Value() + origin, close);
  EXPECT_NEAR(b.Scatter(), factor * a.Scatter(), close);
  EXPECT_NEAR(b.Visible(), factor * a.Visible(), close);
  EXPECT_NEAR(b.Scatter95().high, factor * a.Scatter95().high, close);
  EXPECT_NEAR(b.Next().Middle95().high, factor * a.Next().Middle95().high + origin, 1e-6 * factor);
  EXPECT_NEAR(b.AlikeP(), a.AlikeP(), 1e-9);
}

TEST(RandomEffect, DoesNotAverageASharedErrorAway) {
  const Eigen::VectorXd v = Eigen::VectorXd::Constant(8, 0.25);
  const RandomEffect without = EffectOf(Eight(), v), with = EffectOf(Eight(), v, 900.0);
  EXPECT_NEAR(with.Mean().Sigma(), 30.0, 0.1);  // the rest, 0.7, hardly counts beside it
  EXPECT_NEAR(with.Next().Sigma(), 30.0, 0.3);
  EXPECT_EQ(with.Scatter(), without.Scatter());
  EXPECT_EQ(with.AlikeP(), without.AlikeP());
}

// Shrunken values: with much scatter the trial's own, with none the mean.
TEST(RandomEffect, ShrinksAsFarAsTheTrialsAreAlike) {
  const RandomEffect apart = EffectOf(Eight(), Eigen::VectorXd::Constant(8, 1e-4));
  const RandomEffect alike = EffectOf(Eight(), Eigen::VectorXd::Constant(8, 400.0));
  ASSERT_TRUE(alike.TooAlike());
  for (Eigen::Index i = 0; i < 8; ++i) {
    EXPECT_NEAR(apart.Effect(i).Mean(), Eight()(i), 1e-3);
    EXPECT_NEAR(apart.Effect(i).Sigma(), 0.01, 1e-4);
    EXPECT_NEAR(alike.Effect(i).Mean(), Eight().mean(), 1.0);  // of own errors of 20
  }
}

TEST(RandomEffect, FindsTheOneThatIsUnlike) {
  Eigen::VectorXd y = Eight();
  y(2) = 40.0;
  const auto left = LeaveOneOut(y, Eigen::VectorXd::Constant(8, 0.01));
  for (std::size_t i = 0; i < 8; ++i) {
    if (i == 2) {
      EXPECT_LT(left[i].p, 1e-4);
    } else {
      EXPECT_GT(left[i].p, 0.5);
      EXPECT_GT(left[i].log_density, left[2].log_density);
    }
  }
}

TEST(RandomEffect, TakesIdenticalValues) {
  const RandomEffect same = EffectOf(Eigen::VectorXd::Constant(5, 2.0), Eigen::VectorXd::Ones(5));
  EXPECT_TRUE(same.TooAlike());
  EXPECT_EQ(same.Scatter95().high, 0.0);
  EXPECT_NEAR(same.Mean().Middle95().high, 2.0, 1e-3);
  EXPECT_NEAR(same.Effect(2).Mean(), 2.0, 1e-6);
  EXPECT_NEAR(same.AlikeP(), 1.0, 1e-12);
}

TEST(RandomEffect, RefusesWhatIsNoTrial) {
  const ScatterLevels three(3);
  const Eigen::VectorXd y = Eight().head(3), v = Eigen::VectorXd::Ones(3);
  EXPECT_THROW(ScatterLevels(1), Error);
  EXPECT_THROW(RandomEffect(y, Eigen::VectorXd::Zero(3), 0.0, three), Error);
  EXPECT_THROW(RandomEffect(y, v, -1.0, three), Error);
  EXPECT_THROW(RandomEffect(y * std::nan(""), v, 0.0, three), Error);
  EXPECT_THROW(RandomEffect(Eight(), v, 0.0, three), Error);
  EXPECT_THROW(LeaveOneOut(y.head(2), v.head(2)), Error);
}

TEST(NormalMixture, AgreesWithItself) {
  NormalMixture m;
  m.weight = (Eigen::VectorXd(3) << 0.2, 0.5, 0.3).finished();
  m.mean = (Eigen::VectorXd(3) << -4.0, 1.0, 1.5).finished();
  m.variance = (Eigen::VectorXd(3) << 0.01, 1.0, 900.0).finished();
  for (double p : {1e-6, 0.025, 0.2, 0.5, 0.975, 1.0 - 1e-9}) {
    EXPECT_NEAR(m.Cdf(m.Quantile(p)), p, 1e-9);
  }
  double sum = 0.0;  // of the density, to 7 of its widest standard deviations
  constexpr double kStep = 0.005;
  for (double x = -210.0; x < 210.0; x += kStep) sum += std::exp(m.LogDensity(x)) * kStep;
  EXPECT_NEAR(sum, 1.0, 1e-9);
  EXPECT_NEAR(
      m.LogDensity(1e4),
      std::log(0.3 / (30.0 * std::sqrt(2.0 * M_PI))) - 0.5 * std::pow((1e4 - 1.5) / 30.0, 2), 1e-6);
  EXPECT_NEAR(m.Mean(), 0.15, 1e-12);
}

// How often the intervals hold the truth: trials, scatter in their own errors, unequal errors.
class RandomEffectCoverage : public ::testing::TestWithParam<CampaignCase> {};

TEST_P(RandomEffectCoverage, IsAsStated) {
  constexpr std::size_t kCampaigns = 1200;
  const CoverageCount count = CoverageOf(GetParam(), kCampaigns);
  const bool none = GetParam().scatter == 0.0;
  ExpectWithin(count.mean, kCampaigns, 0.93, 0.97);
  // Without scatter the upper end alone can miss.
  ExpectWithin(count.scatter, kCampaigns, none ? 0.975 : 0.95, none ? 0.975 : 0.95);
  // Where the trials' own errors hide the scatter, few trials leave it open, and more is covered.
  ExpectWithin(count.next, kCampaigns, 0.93, GetParam().scatter < 1.0 ? 1.0 : 0.97);
  ExpectWithin(count.left_out, kCampaigns, 0.93, GetParam().scatter < 1.0 ? 1.0 : 0.985);
}

INSTANTIATE_TEST_SUITE_P(Campaigns, RandomEffectCoverage,
                         ::testing::Values(CampaignCase{3, 0.0, false}, CampaignCase{3, 1.0, true},
                                           CampaignCase{3, 10.0, false}, CampaignCase{5, 0.3, true},
                                           CampaignCase{5, 3.0, false}, CampaignCase{8, 0.0, true},
                                           CampaignCase{8, 1.0, true}, CampaignCase{8, 3.0, true},
                                           CampaignCase{20, 0.3, false},
                                           CampaignCase{20, 1.0, true}));

}  // namespace
}  // namespace unfurl::correlate::random_effect_test
