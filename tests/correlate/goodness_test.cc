// Whether a model explains its data, on residuals whose distribution is known.
#include "correlate/fit/goodness.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "base/statistics.h"

namespace unfurl::correlate::goodness_test {
namespace {

constexpr int kSamples = 240, kSections = 8;

Observations TwoMarks() {
  Observations o;
  for (const char* name : {"a", "b"}) {
    MarkSeries m;
    m.name = name;
    for (int i = 0; i < kSamples; ++i) m.t.push_back(0.005 * i);
    o.marks.push_back(std::move(m));
  }
  return o;
}

Eigen::VectorXd White(std::uint64_t seed) {
  Rng rng(seed);
  Eigen::VectorXd r(2 * 3 * kSamples);
  for (double& x : r) x = rng.Normal();
  return r;
}

GoodnessInput InputOf(const Observations& o, const Eigen::VectorXd& r, const ResidualNoise& noise) {
  GoodnessInput in;
  in.observations = &o;
  in.plain = in.whitened = &noise;
  in.whitened_residual = &r;
  in.squares = r.squaredNorm();
  in.dof = static_cast<double>(r.size());
  in.sections = kSections;
  return in;
}

TEST(Goodness, PValuesOfWhiteResidualsAreEven) {
  const Observations o = TwoMarks();
  constexpr int kSeeds = 400;
  int doubted = 0, steady_half = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Eigen::VectorXd r = White(seed + 1);
    const ResidualNoise noise = EstimateResidualNoise(o, r);
    doubted += TestGoodness(InputOf(o, r, noise)).outcome == Explained::kYes ? 0 : 1;
    steady_half += SteadyPValue(o, r, kSections) < 0.5 ? 1 : 0;
  }
  // At 99.9% of a right test.
  EXPECT_LE(BinomialInterval(static_cast<std::size_t>(doubted), kSeeds, 0.998).first,
            kGoodnessLevel);
  const auto [low, high] = BinomialInterval(static_cast<std::size_t>(steady_half), kSeeds, 0.998);
  EXPECT_LE(low, 0.5);
  EXPECT_GE(high, 0.5);
}

TEST(Goodness, ABurstIsNoNoise) {
  const Observations o = TwoMarks();
  Eigen::VectorXd r = White(7);
  for (int i = 100; i < 130; ++i) r(3 * i) *= 4.0;  // white, and of one time
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  EXPECT_LT(SteadyPValue(o, r, kSections), 1e-6);
  EXPECT_EQ(TestGoodness(InputOf(o, r, noise)).outcome, Explained::kNo);
}

// A record of 60 readings has not ten in each of eight sections: it is cut into fewer.
TEST(Goodness, FewReadingsAreCutIntoFewerSections) {
  constexpr int kFew = 60, kSeeds = 400;
  Observations o;
  MarkSeries m;
  m.name = "a";
  for (int i = 0; i < kFew; ++i) m.t.push_back(0.005 * i);
  o.marks.push_back(std::move(m));
  int low = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    Rng rng(seed + 1);
    Eigen::VectorXd r(3 * kFew);
    for (double& x : r) x = rng.Normal();
    low += SteadyPValue(o, r, kSections) < 0.05 ? 1 : 0;
    r.tail(3 * kFew / 2) *= 4.0;
    EXPECT_LT(SteadyPValue(o, r, kSections), 1e-4);
    EXPECT_LT(LargestStretchPValue(o, r, kSections), 1e-4);
    r *= 0.1;
    EXPECT_GT(LargestStretchPValue(o, r, kSections), 0.05);
  }
  // At 99.9% of a right test.
  const auto [least, most] = BinomialInterval(static_cast<std::size_t>(low), kSeeds, 0.998);
  EXPECT_LE(least, 0.05);
  EXPECT_GE(most, 0.05);
}

// Covariances that claim too much noise, here and there, are no fault of the model.
TEST(Goodness, StretchesBelowWhatIsClaimedAreNoMisfit) {
  const Observations o = TwoMarks();
  Eigen::VectorXd r = White(7);
  r.head(3 * kSamples) *= 0.3;
  for (int i = 100; i < 130; ++i) r(3 * i) *= 3.0;  // unsteady, and below the claim all along
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  EXPECT_LT(SteadyPValue(o, r, kSections), 1e-6);
  EXPECT_GT(LargestStretchPValue(o, r, kSections), 0.05);
  GoodnessInput in = InputOf(o, r, noise);
  in.residual = &r;
  EXPECT_EQ(TestGoodness(in).p_steady, LargestStretchPValue(o, r, kSections));
  // The same burst above the claim is one still.
  Eigen::VectorXd burst = White(7);
  for (int i = 100; i < 130; ++i) burst(3 * i) *= 4.0;
  in.whitened_residual = in.residual = &burst;
  EXPECT_LT(TestGoodness(in).p_steady, 1e-6);
}

TEST(Goodness, LargerWhiteResidualsAreNoise) {
  const Observations o = TwoMarks();
  const Eigen::VectorXd r = 1.3 * White(8);
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  const GoodnessOfFit g = TestGoodness(InputOf(o, r, noise));
  EXPECT_EQ(g.outcome, Explained::kNoise);
  EXPECT_NEAR(g.excess, std::sqrt(1.3 * 1.3 - 1.0), 0.1);
}

TEST(Goodness, TheMeshIsKnownByItsShape) {
  const Observations o = TwoMarks();
  Eigen::VectorXd r = White(9), mesh(r.size()), other(r.size());
  for (Eigen::Index i = 0; i < r.size(); ++i) {
    const double t = static_cast<double>(i / 3);
    mesh(i) = 3.0 * std::sin(0.11 * t) * t / kSamples;
    other(i) = 3.0 * std::sin(0.17 * t + 0.3) * t / kSamples;
  }
  r += mesh;
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  auto with = [&](const Eigen::VectorXd& finer) {
    GoodnessInput in = InputOf(o, r, noise);
    in.left = r.squaredNorm();
    in.finer = finer.squaredNorm();
    in.left_by_finer = r.dot(finer);
    return TestGoodness(in);
  };
  EXPECT_EQ(with(-mesh).outcome, Explained::kMesh);
  EXPECT_EQ(with(-2.0 * mesh).outcome, Explained::kMesh);  // its size is not well known
  EXPECT_GT(with(-mesh).mesh_takes, 0.9);
  EXPECT_EQ(with(mesh).outcome, Explained::kNo);  // the other way
  EXPECT_EQ(with(-0.01 * mesh).outcome, Explained::kNo);
  EXPECT_EQ(with(other).outcome, Explained::kNo);
  EXPECT_EQ(with(-other).outcome, Explained::kNo);
}

// The finer mesh's factor is that of the fit of what is left to its change, -left_by_finer / finer,
// and what it takes is that factor's share of what is left beyond the noise.
TEST(Goodness, WhatTheMeshTakesInClosedForm) {
  const Observations o = TwoMarks();
  const Eigen::VectorXd r = 2.0 * White(10);  // by size alone no explanation
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  const auto with = [&](double beyond, double finer, double product) {
    GoodnessInput in = InputOf(o, r, noise);
    in.dof = 1000.0;
    in.left = 1000.0 + beyond;
    in.finer = finer;
    in.left_by_finer = product;
    return TestGoodness(in);
  };
  EXPECT_NEAR(with(100.0, 50.0, -60.0).mesh_takes, 1.2 * 0.6, 1e-12);
  EXPECT_EQ(with(100.0, 50.0, -60.0).outcome, Explained::kMesh);
  EXPECT_NEAR(with(100.0, 50.0, -40.0).mesh_takes, 0.8 * 0.4, 1e-12);
  EXPECT_NE(with(100.0, 50.0, -40.0).outcome, Explained::kMesh);
  EXPECT_EQ(with(50.0, 50.0, -60.0).mesh_takes, 1.0);
  // Half of it is the limit.
  EXPECT_EQ(with(100.0, 51.0, -51.0).outcome, Explained::kMesh);
  EXPECT_NE(with(100.0, 49.0, -49.0).outcome, Explained::kMesh);
  // A factor of four to either side.
  EXPECT_GT(with(100.0, 10.0, -39.0).mesh_takes, 0.9);
  EXPECT_EQ(with(100.0, 10.0, -41.0).mesh_takes, 0.0);
  EXPECT_GT(with(2.0, 10.0, -2.6).mesh_takes, 0.3);
  EXPECT_EQ(with(2.0, 10.0, -2.4).mesh_takes, 0.0);
  EXPECT_EQ(with(-1.0, 50.0, -50.0).mesh_takes, 0.0);
  EXPECT_EQ(with(100.0, 50.0, 60.0).mesh_takes, 0.0);
  EXPECT_EQ(with(100.0, 0.0, -60.0).mesh_takes, 0.0);
}

// Two P-values together: the smaller, doubled, at most 1.
TEST(Goodness, TwoPValuesTogether) {
  GoodnessOfFit g;
  g.p_size = 0.003;
  g.p_white = 0.4;
  g.p_found = 0.7;
  g.p_steady = 0.6;
  EXPECT_NEAR(g.p_covariances(), 0.006, 1e-15);
  EXPECT_EQ(g.p_noise(), 1.0);
}

TEST(Goodness, TheExcessIsInQuadrature) {
  const Observations o = TwoMarks();
  const Eigen::VectorXd r = White(11);
  const ResidualNoise noise = EstimateResidualNoise(o, r);
  GoodnessInput in = InputOf(o, r, noise);
  in.dof = 400.0;
  in.squares = 500.0;
  EXPECT_NEAR(TestGoodness(in).excess, 0.5, 1e-12);
  EXPECT_NEAR(TestGoodness(in).p_size, ChiSquareTail(500.0, 400.0), 1e-15);
  in.squares = 300.0;
  EXPECT_EQ(TestGoodness(in).excess, 0.0);
}

// One series, two sections of n values with variances a and b: Bartlett's statistic is n log((a +
// b)^2 / (4 a b)) over 1 + (2 / n - 1 / (2 n)) / 3.
TEST(Goodness, BartlettsStatisticOfTwoSections) {
  constexpr int kN = 20;
  Observations o;
  MarkSeries m;
  m.name = "a";
  for (int i = 0; i < 2 * kN; ++i) m.t.push_back(0.01 * i);
  o.marks.push_back(m);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(3 * 2 * kN);
  const double a = 1.0, b = 2.5;
  for (int i = 0; i < 2 * kN; ++i) r(3 * i) = (i % 2 ? 1.0 : -1.0) * std::sqrt(i < kN ? a : b);
  const double statistic =
      kN * std::log((a + b) * (a + b) / (4.0 * a * b)) / (1.0 + (2.0 / kN - 0.5 / kN) / 3.0);
  EXPECT_NEAR(SteadyPValue(o, r, 2), ChiSquareTail(statistic, 1.0), 1e-12);
  // Five values a section say nothing: there are as many sections as have ten.
  EXPECT_EQ(SteadyPValue(o, r, 8), SteadyPValue(o, r, 4));
  Observations few;
  m.t.resize(19);
  few.marks.push_back(m);
  EXPECT_EQ(SteadyPValue(few, r.head(3 * 19), 8), 1.0);
}

// Noise a + b / (1 - rho z): its power at frequency 0 is a + b (1 + rho) / (1 - rho), the most it
// has.
TEST(Believed, WhatHasLessPowerThanIsStatedGivesWay) {
  Observations o = TwoMarks();
  constexpr double kSigma = 1e-3, kMotion = 0.7;  // [m]
  for (MarkSeries& mark : o.marks) {
    mark.p.setZero(3, kSamples);
    for (int i = 0; i < kSamples; ++i) mark.p(0, i) = i % 2 == 0 ? kMotion : -kMotion;
    mark.cov.setZero(6, kSamples);
    for (const int row : {0, 3, 5}) mark.cov.row(row).setConstant(kSigma * kSigma);
  }
  EXPECT_NEAR(LeastNoiseOverMotion(o), std::sqrt(3.0) * kSigma / kMotion, 1e-12);
  constexpr double kShare = 0.5, kRho = 0.9, kPeak = 0.5 + 0.5 * 19.0;
  auto noise = [&](double peak) {
    SeriesNoise found;
    found.series.assign(6, {peak / kPeak, kShare, kRho});
    return found;
  };
  EXPECT_NEAR(noise(1.0).series[0].Peak(), 1.0, 1e-12);
  const SeriesNoise less = Believed(noise(0.99), o);
  EXPECT_TRUE(less.below);
  EXPECT_TRUE(less.white());
  const SeriesNoise more = Believed(noise(1.01), o);
  EXPECT_FALSE(more.below);
  EXPECT_FALSE(more.white());
  // One series of more power, and the residuals are not below as a whole.
  SeriesNoise one = noise(0.5);
  one.series[4].variance = 1.0;
  EXPECT_FALSE(Believed(one, o).below);
  EXPECT_TRUE(Believed(one, o).series[0].white());
  // White ones are the covariances' affair, and those below a simulation's tolerance nobody's.
  EXPECT_FALSE(Believed(SeriesNoise{.series = {6, MarkovNoise{}}}, o).below);
  for (MarkSeries& mark : o.marks) mark.cov *= 1e-6;
  EXPECT_FALSE(Believed(noise(0.5), o).below);
  EXPECT_FALSE(Believed(noise(0.5), o).white());
}

// A slow wave of a hundredth of the sigma is explained; with a burst above the sigma it is not.
TEST(Goodness, APatternBelowTheNoiseIsNoMisfit) {
  const Observations o = TwoMarks();
  Eigen::VectorXd r(2 * 3 * kSamples);
  for (Eigen::Index i = 0; i < r.size(); ++i) r(i) = 0.01 * std::sin(0.01 * static_cast<double>(i));
  auto outcome = [&](bool below) {
    const ResidualNoise noise = EstimateResidualNoise(o, r);
    GoodnessInput in = InputOf(o, r, noise);
    in.residual = &r;
    in.below = below;
    return TestGoodness(in).outcome;
  };
  EXPECT_EQ(outcome(true), Explained::kYes);
  EXPECT_EQ(outcome(false), Explained::kNo);
  for (Eigen::Index i = 0; i < 60; ++i) r(i) += i % 6 < 3 ? 5.0 : -5.0;
  EXPECT_EQ(outcome(true), Explained::kNo);
}

}  // namespace
}  // namespace unfurl::correlate::goodness_test
