// Whether a model explains its data, on residuals whose distribution is known.
#include "correlate/fit/goodness.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "base/statistics.h"

namespace unfurl::correlate {
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

}  // namespace
}  // namespace unfurl::correlate
