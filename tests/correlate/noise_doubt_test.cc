// What a noise may be beside the likeliest: against the restricted likelihood with dense
// covariances.
#include "correlate/fit/noise_doubt.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "correlate/fit/noise_contrasts.h"

namespace unfurl::correlate::noise_doubt_test {
namespace {

constexpr Eigen::Index kReadings = 60;

// One mark; its first axis has noise with a memory, and so have the others.
Observations OneMark() {
  Observations o;
  MarkSeries mark;
  mark.name = "a";
  for (Eigen::Index i = 0; i < kReadings; ++i) mark.t.push_back(0.01 * static_cast<double>(i));
  mark.p = Eigen::Matrix3Xd::Zero(3, kReadings);
  mark.cov = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, kReadings);
  o.marks.push_back(std::move(mark));
  return o;
}

struct Drawn {
  Observations observations = OneMark();
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(3 * kReadings);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3 * kReadings, 2);
  SeriesNoise found;

  // Residuals of a straight line and a swing, fitted.
  explicit Drawn(std::uint64_t seed, double rho) {
    Rng rng(seed);
    Eigen::Vector3d state;
    for (double& x : state) x = rng.Normal();
    for (Eigen::Index i = 0; i < kReadings; ++i) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        if (i > 0) state(axis) = rho * state(axis) + std::sqrt(1.0 - rho * rho) * rng.Normal();
        residual(3 * i + axis) = state(axis);
        A(3 * i + axis, 0) = static_cast<double>(i) / static_cast<double>(kReadings);
        A(3 * i + axis, 1) = std::sin(0.1 * static_cast<double>(i * (axis + 1)));
      }
    }
    residual -= A * A.colPivHouseholderQr().solve(residual);
    found = FitSeriesNoise(observations, residual, A);
  }
};

// With the little white noise that the filter leaves.
Eigen::MatrixXd Dense(const MarkovNoise& noise) {
  const double share = std::min(noise.share, kLargestShare);
  Eigen::MatrixXd G(kReadings, kReadings);
  for (Eigen::Index i = 0; i < kReadings; ++i) {
    for (Eigen::Index j = 0; j < kReadings; ++j) {
      const double lag = static_cast<double>(std::abs(i - j));
      G(i, j) = share * std::pow(noise.rho, lag) + (i == j ? 1.0 - share : 0.0);
    }
  }
  return G;
}

// Restricted log-likelihood of all three axes at the best common variance, each axis giving its own
// contrasts: explicit null spaces and determinants.
double Restricted(const Drawn& drawn, const MarkovNoise& noise) {
  const Eigen::MatrixXd G = Dense(noise);
  double squares = 0.0, logdet = 0.0, dof = 0.0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd y(kReadings);
    Eigen::MatrixXd X(kReadings, 2);
    for (Eigen::Index i = 0; i < kReadings; ++i) {
      y(i) = drawn.residual(3 * i + axis);
      X.row(i) = drawn.A.row(3 * i + axis);
    }
    const Eigen::MatrixXd Q = X.householderQr().householderQ();
    const Eigen::MatrixXd K = Q.rightCols(kReadings - 2);
    const Eigen::MatrixXd S = K.transpose() * G * K;
    const Eigen::LLT<Eigen::MatrixXd> llt(S);
    const Eigen::VectorXd z = K.transpose() * y;
    squares += z.dot(llt.solve(z));
    for (Eigen::Index i = 0; i < S.rows(); ++i) logdet += 2.0 * std::log(llt.matrixL()(i, i));
    dof += static_cast<double>(kReadings - 2);
  }
  return -0.5 * (dof * std::log(squares / dof) + logdet);
}

TEST(NoiseDoubt, WeightsAreTheRestrictedLikelihood) {
  const Drawn drawn(1, 0.9);
  ASSERT_FALSE(drawn.found.series[0].white());
  const std::vector<NoiseGroup> groups =
      LikelyNoises(drawn.observations, drawn.residual, drawn.A, drawn.found);
  ASSERT_EQ(groups.size(), 1u) << drawn.found.pooled;
  const std::vector<LikelyNoise>& likely = groups[0].likely;
  ASSERT_GT(likely.size(), 5u);
  double total = 0.0;
  const double first = Restricted(drawn, likely[0].noise);
  for (const LikelyNoise& one : likely) {
    total += one.weight;
    constexpr double kSame = 1e-7;  // of the logarithm
    EXPECT_NEAR(std::log(one.weight / likely[0].weight), Restricted(drawn, one.noise) - first,
                kSame);
  }
  constexpr double kLeftOut = 0.05;  // what is less likely than 1e-3 each
  EXPECT_NEAR(total, 1.0, kLeftOut);
}

// The sum over noises, with dense covariances.
TEST(NoiseDoubt, TheCovarianceIsAveraged) {
  const Drawn drawn(2, 0.8);
  const Eigen::Index n = 3 * kReadings;
  const auto inverse_of = [&](const MarkovNoise& noise) {
    const Eigen::MatrixXd own = (noise.variance * Dense(noise)).inverse();
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      for (Eigen::Index i = 0; i < kReadings; ++i) {
        for (Eigen::Index j = 0; j < kReadings; ++j) all(3 * i + axis, 3 * j + axis) = own(i, j);
      }
    }
    return all;
  };
  // Of three unknowns this trial has the last and the first; the others tell of all.
  StackedRows all;
  all.blocks.push_back({0, n, 2, 1});
  all.A = Eigen::MatrixXd::Zero(n, 3);
  all.A.col(0) = drawn.A.col(0), all.A.col(2) = drawn.A.col(1);
  Eigen::Matrix3d others;
  others << 2.0, 0.5, 0.1, 0.5, 3.0, 0.4, 0.1, 0.4, 0.2;
  const Eigen::MatrixXd W = inverse_of(drawn.found.series[0]);
  const Eigen::MatrixXd normal = others + all.A.transpose() * W * all.A;
  const Eigen::MatrixXd covariance = normal.inverse();
  // As a fit has it: at the minimum by the noise found.
  const Eigen::MatrixXd& A = drawn.A;
  const Eigen::VectorXd residual =
      drawn.residual - A * (A.transpose() * W * A).inverse() * (A.transpose() * W * drawn.residual);
  const std::vector<NoiseGroup> groups = LikelyNoises(drawn.observations, residual, A, drawn.found);
  ASSERT_EQ(groups.size(), 1u);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(3, 3);
  for (const LikelyNoise& one : groups[0].likely) {
    const Eigen::MatrixXd V = inverse_of(one.noise);
    const Eigen::MatrixXd C = (others + all.A.transpose() * V * all.A).inverse();
    const Eigen::VectorXd shift = C * (all.A.transpose() * V * residual);
    expected += one.weight * (C - covariance + shift * shift.transpose());
  }
  // What of it takes away is left out.
  const Eigen::Vector3d unit = covariance.diagonal().cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Eigen::MatrixXd(
      unit.cwiseInverse().asDiagonal() * expected * unit.cwiseInverse().asDiagonal()));
  const Eigen::MatrixXd vectors = unit.asDiagonal() * eigen.eigenvectors();
  expected = vectors * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * vectors.transpose();
  ASSERT_GT(expected(0, 0), 0.1 * covariance(0, 0));
  NoiseDoubtInput in{&drawn.observations, &drawn.found, &residual, {}, {}, &normal, &covariance};
  in.TakeRows(all, 0, 1);
  const Eigen::MatrixXd found = DoubtOfNoise(in);
  constexpr double kClose = 1e-6;  // of it
  EXPECT_LT((found - expected).norm(), kClose * expected.norm());
}

TEST(NoiseDoubt, WhiteNoiseIsNotDoubted) {
  const Drawn drawn(3, 0.0);
  ASSERT_TRUE(drawn.found.series[0].white());
  EXPECT_TRUE(LikelyNoises(drawn.observations, drawn.residual, drawn.A, drawn.found).empty());
}

}  // namespace
}  // namespace unfurl::correlate::noise_doubt_test
