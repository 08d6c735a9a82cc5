// Readings that are better than the calibration: what its errors do to them is no contradiction.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "base/random_vector.h"
#include "base/statistics.h"
#include "measure/triangulate.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::calibrated_residual_test {
namespace {

constexpr double kReading = 0.003;  // [px], a tenth of what the calibration's errors make

// The shipped rig, known to what a survey by readings of 0.1 px may leave: independent errors of
// all parameters, and six directions that all cameras share. `root` root^T is its covariance.
data::Rig KnownRoughly(Eigen::MatrixXd* root) {
  data::Rig rig = ShippedRig();
  const Eigen::Index size = rig.covariance.rows();
  Rng rng(17);
  Eigen::VectorXd sigma(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Eigen::Index k = i % data::kCameraParameters;
    sigma(i) = k < 3 ? 5e-6 : k < 6 ? 2e-5 : k < 8 ? 0.02 : k == 8 ? 5e-5 : 0.02;
  }
  Eigen::MatrixXd mix = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index k = 0; k < 6; ++k) {
    for (Eigen::Index i = 0; i < size; ++i) mix(i, k) += rng.Normal();
  }
  *root = sigma.asDiagonal() * mix;
  rig.covariance = *root * root->transpose();
  rig.model_floor_px = 0.0;
  for (data::RigCamera& camera : rig.cameras) camera.floor_px = 0.0;
  return rig;
}

data::Rig Shifted(const data::Rig& rig, const Eigen::VectorXd& change) {
  data::Rig out = rig;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    out.cameras[c] =
        Perturbed(rig.cameras[c], change.segment<data::kCameraParameters>(
                                      static_cast<Eigen::Index>(c) * data::kCameraParameters));
  }
  return out;
}

std::vector<double> Read(const data::Rig& truth, const Eigen::Vector3d& p, Rng* rng) {
  std::vector<double> u(truth.cameras.size());
  for (std::size_t c = 0; c < u.size(); ++c) {
    EXPECT_TRUE(Project(truth.cameras[c], p, &u[c]));
    u[c] += kReading * rng->Normal();
  }
  return u;
}

// Over rigs drawn from the covariance, each of them the truth once.
TEST(CalibratedResidual, GoodReadingsFailAsOftenAsStatedWhateverTheCalibrationsErrors) {
  constexpr int kDraws = 2000;
  Eigen::MatrixXd root;
  const data::Rig rig = KnownRoughly(&root);
  data::Rig exact = rig;
  exact.covariance.setZero();
  // At a hundredth, that few draws tell.
  const TriangulateOptions options{.residual_level = 0.01};
  const Triangulator with(rig, options), without(exact, options);
  const std::vector<double> s(rig.cameras.size(), kReading);
  Rng rng(18);
  int failed = 0, failed_without = 0;
  for (int i = 0; i < kDraws; ++i) {
    Eigen::VectorXd z(root.cols());
    for (Eigen::Index j = 0; j < z.size(); ++j) z(j) = rng.Normal();
    const Eigen::Vector3d p = UniformVector(&rng, -0.8, 0.8);
    const std::vector<double> u = Read(Shifted(rig, root * z), p, &rng);
    const auto outcome = with.Solve(u, s, p).outcome;
    ASSERT_TRUE(outcome == PointOutcome::kSolved || outcome == PointOutcome::kDisagree);
    failed += outcome == PointOutcome::kDisagree;
    failed_without += without.Solve(u, s, p).outcome == PointOutcome::kDisagree;
  }
  // Four standard errors of the binomial.
  EXPECT_NEAR(failed, 0.01 * kDraws, 4.0 * std::sqrt(0.01 * kDraws));
  EXPECT_GT(failed_without, kDraws / 2);
}

// The same number by another way: least squares over the place and all errors of the calibration
// together, each of which costs its square; derivatives by differences.
TEST(CalibratedResidual, IsTheJointLeastSquares) {
  constexpr double kByDifferences = 1e-4;  // relative, of central differences
  constexpr double kStep = 1e-3;           // of a sigma of the calibration's errors
  Eigen::MatrixXd root;
  const data::Rig rig = KnownRoughly(&root);
  const Triangulator triangulator(rig);
  const std::vector<double> s(rig.cameras.size(), kReading);
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  Rng rng(19);
  int compared = 0;
  for (int i = 0; i < 8; ++i) {
    Eigen::VectorXd z(root.cols());
    for (Eigen::Index j = 0; j < z.size(); ++j) z(j) = rng.Normal();
    const Eigen::Vector3d p = UniformVector(&rng, -0.8, 0.8);
    const std::vector<double> u = Read(Shifted(rig, root * z), p, &rng);
    const PointSolution point = triangulator.Solve(u, s, p);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n + root.cols(), 3 + root.cols());
    Eigen::VectorXd b = Eigen::VectorXd::Zero(n + root.cols());
    double plain = 0.0;
    const auto reading = [](const data::Rig& of, Eigen::Index c, const Eigen::Vector3d& at) {
      double value = 0.0;
      EXPECT_TRUE(Project(of.cameras[static_cast<std::size_t>(c)], at, &value));
      return value;
    };
    for (Eigen::Index c = 0; c < n; ++c) {
      b(c) = (u[static_cast<std::size_t>(c)] - reading(rig, c, point.p)) / kReading;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d d = 1e-5 * Eigen::Vector3d::Unit(k);
        A(c, k) = (reading(rig, c, point.p + d) - reading(rig, c, point.p - d)) / 2e-5 / kReading;
      }
    }
    for (Eigen::Index j = 0; j < root.cols(); ++j) {
      const data::Rig up = Shifted(rig, kStep * root.col(j));
      const data::Rig down = Shifted(rig, -kStep * root.col(j));
      for (Eigen::Index c = 0; c < n; ++c) {
        A(c, 3 + j) =
            (reading(up, c, point.p) - reading(down, c, point.p)) / (2.0 * kStep * kReading);
      }
      A(n + j, 3 + j) = 1.0;
    }
    plain = (b.head(n) -
             A.topLeftCorner(n, 3) * A.topLeftCorner(n, 3).householderQr().solve(b.head(n).eval()))
                .squaredNorm();
    if (plain < ChiSquareQuantile(1.0 - TriangulateOptions{}.residual_level, 1.0)) continue;
    ++compared;
    const double joint = (b - A * A.householderQr().solve(b)).squaredNorm();
    EXPECT_LT(joint, 0.2 * plain);
    EXPECT_NEAR(point.chi_square, joint, kByDifferences * joint);
  }
  EXPECT_GE(compared, 3);
}

TEST(CalibratedResidual, AWrongReadingIsNoticedAllTheSame) {
  Eigen::MatrixXd root;
  const data::Rig rig = KnownRoughly(&root);
  const Triangulator triangulator(rig);
  const std::vector<double> s(rig.cameras.size(), kReading);
  Rng rng(20);
  const Eigen::Vector3d p(0.3, -0.4, 0.2);
  for (const double off : {2.0, 30.0, 500.0}) {
    std::vector<double> u = Read(rig, p, &rng);
    u[1] += off;
    EXPECT_NE(triangulator.Solve(u, s, p).outcome, PointOutcome::kSolved) << off;
  }
}

}  // namespace
}  // namespace unfurl::measure::calibrated_residual_test
