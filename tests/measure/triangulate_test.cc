#include "measure/triangulate.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/statistics.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure::triangulate_test {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::vector<double> Readings(const data::Rig& rig, const Eigen::Vector3d& p) {
  std::vector<double> u(rig.cameras.size());
  for (std::size_t c = 0; c < u.size(); ++c) EXPECT_TRUE(Project(rig.cameras[c], p, &u[c]));
  return u;
}

TEST(Triangulate, ProjectThenReconstructIsTheIdentity) {
  constexpr double kRoundOff = 1e-9;  // [m]; pixels carry 13 digits
  const Triangulator triangulator(ShippedRig());
  const Eigen::Matrix3Xd points =
      RandomPoints(ShippedRig().volume_low, ShippedRig().volume_high, 300, 5);
  const std::vector<double> s(4, 0.02);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const std::vector<double> u = Readings(ShippedRig(), points.col(i));
    // With all four, and with any three; from the volume's middle.
    for (int missing = -1; missing < 4; ++missing) {
      const std::uint32_t use = missing < 0 ? ~0U : ~(1U << missing);
      const PointSolution point = triangulator.Solve(u, s, triangulator.centre(), use);
      ASSERT_EQ(point.outcome, PointOutcome::kSolved) << Name(point.outcome);
      EXPECT_LT((point.p - points.col(i)).norm(), kRoundOff);
      EXPECT_EQ(point.readings, missing < 0 ? 4 : 3);
      EXPECT_LT(point.dilution, 0.008);  // the layout: no single loss ruins it
    }
  }
}

TEST(Triangulate, CovarianceIsTheScatter) {
  // Normalised squared errors of 4000 draws: mean 3 within four standard errors; and each entry of
  // the scatter's matrix, whitened by the covariance, is the identity's.
  constexpr int kDraws = 4000;
  data::Rig rig = ShippedRig();
  rig.model_floor_px = 0.03;
  const Triangulator triangulator(rig);
  const Eigen::Vector3d truth(0.4, -0.6, 0.5);
  const std::vector<double> exact = Readings(rig, truth);
  const std::vector<double> s = {0.02, 0.05, 0.01, 0.03};
  Rng rng(4);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  double nees = 0.0, chi_square = 0.0;
  Eigen::Matrix3d whiten;
  for (int i = 0; i < kDraws; ++i) {
    std::vector<double> u = exact;
    for (std::size_t c = 0; c < 4; ++c) u[c] += std::hypot(s[c], rig.model_floor_px) * rng.Normal();
    const PointSolution point = triangulator.Solve(u, s, truth);
    const Eigen::Vector3d e = point.p - truth;
    whiten = point.cov.llt().matrixL().toDenseMatrix().inverse();
    nees += (whiten * e).squaredNorm() / kDraws;
    chi_square += point.chi_square / kDraws;
    scatter += whiten * e * e.transpose() * whiten.transpose() / kDraws;
  }
  EXPECT_NEAR(nees, 3.0, 4.0 * std::sqrt(6.0 / kDraws));
  EXPECT_NEAR(chi_square, 1.0, 4.0 * std::sqrt(2.0 / kDraws));
  EXPECT_LT((scatter - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(),
            5.0 * std::sqrt(2.0 / kDraws));
}

TEST(Triangulate, SharedPartIsWhatRedrawnRigsDo) {
  // A rig with a correlated covariance; readings of the true rig, solved with rigs drawn from it.
  constexpr int kDraws = 3000;
  data::Rig rig = ShippedRig();
  const Eigen::Index size = rig.covariance.rows();
  Rng rng(8);
  Eigen::VectorXd sigma(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const Eigen::Index k = i % data::kCameraParameters;
    sigma(i) = k < 3 ? 2e-5 : k < 6 ? 1e-4 : k < 8 ? 0.05 : k == 8 ? 2e-4 : 0.05;
  }
  // A few directions common to all cameras, as a bundle has them, beside independent ones.
  Eigen::MatrixXd mix = Eigen::MatrixXd::Identity(size, size);
  for (Eigen::Index k = 0; k < 6; ++k) {
    for (Eigen::Index i = 0; i < size; ++i) mix(i, k) += rng.Normal();
  }
  const Eigen::MatrixXd root = sigma.asDiagonal() * mix;
  rig.covariance = root * root.transpose();

  const Triangulator triangulator(rig);
  const int k = triangulator.shared_rank();
  EXPECT_LT(k, size);
  EXPECT_GT(k, 5);
  const std::vector<double> s(4, 0.02);
  const Eigen::Vector3d here(0.5, 0.4, -0.3), there(-0.7, 0.2, 0.6);
  const std::vector<double> u_here = Readings(rig, here), u_there = Readings(rig, there);
  Eigen::MatrixXd F(6, k);
  Eigen::Matrix3Xd part(3, k);
  triangulator.SharedFactor(triangulator.Solve(u_here, s, here), s, part);
  F.topRows<3>() = part;
  triangulator.SharedFactor(triangulator.Solve(u_there, s, there), s, part);
  F.bottomRows<3>() = part;
  const Eigen::MatrixXd predicted = F * F.transpose();  // of both points together

  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(6, 6);
  for (int i = 0; i < kDraws; ++i) {
    Eigen::VectorXd z(size);
    for (Eigen::Index j = 0; j < size; ++j) z(j) = rng.Normal();
    const Eigen::VectorXd change = root * z;
    data::Rig drawn = rig;
    drawn.covariance.setZero();
    for (std::size_t c = 0; c < 4; ++c) {
      drawn.cameras[c] =
          Perturbed(rig.cameras[c], change.segment<data::kCameraParameters>(
                                        static_cast<Eigen::Index>(c) * data::kCameraParameters));
    }
    const Triangulator other(drawn, {.residual_level = 1e-12});
    Eigen::VectorXd e(6);
    // The rig moves readings by far more than s: the residual test is not what is looked at.
    e.head<3>() = other.Solve(u_here, s, here).p - here;
    e.tail<3>() = other.Solve(u_there, s, there).p - there;
    scatter += e * e.transpose() / kDraws;
  }
  // Whitened by what is predicted, the scatter of both points is the identity to within five
  // standard errors, and 2% for what is not linear.
  const Eigen::MatrixXd whiten = predicted.llt().matrixL().toDenseMatrix().inverse();
  EXPECT_LT((whiten * scatter * whiten.transpose() - Eigen::MatrixXd::Identity(6, 6))
                .cwiseAbs()
                .maxCoeff(),
            5.0 * std::sqrt(2.0 / kDraws) + 0.02);
}

TEST(Triangulate, TheReducedFactorLosesNothingThatMatters) {
  constexpr double kLost = 3e-6;  // of the variance; points between the grid's may lose a bit more
  data::Rig rig = ShippedRig();
  Rng rng(9);
  const Eigen::Index size = rig.covariance.rows();
  Eigen::MatrixXd root(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < size; ++i) root(i, j) = 1e-5 * rng.Normal();
  }
  rig.covariance = root * root.transpose();
  const Triangulator reduced(rig), whole(rig, {.shared_tolerance = 0.0});
  EXPECT_LT(reduced.shared_rank(), whole.shared_rank());
  const std::vector<double> s(4, 0.02);
  const Eigen::Matrix3Xd points = RandomPoints(rig.volume_low, rig.volume_high, 50, 5);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const PointSolution point = reduced.Solve(Readings(rig, points.col(i)), s, points.col(i));
    Eigen::Matrix3Xd F(3, reduced.shared_rank()), G(3, whole.shared_rank());
    reduced.SharedFactor(point, s, F);
    whole.SharedFactor(point, s, G);
    EXPECT_LT(1.0 - F.squaredNorm() / G.squaredNorm(), kLost);
  }
}

TEST(Triangulate, OneWrongReadingIsNoticed) {
  const Triangulator triangulator(ShippedRig());
  const Eigen::Vector3d truth(0.2, 0.1, 0.0);
  const std::vector<double> s(4, 0.02);
  for (std::size_t c = 0; c < 4; ++c) {
    std::vector<double> u = Readings(ShippedRig(), truth);
    u[c] += 3.0;
    const PointSolution point = triangulator.Solve(u, s, triangulator.centre());
    EXPECT_EQ(point.outcome, PointOutcome::kDisagree);
    // Without it the other three give the point.
    const PointSolution others = triangulator.Solve(u, s, triangulator.centre(), ~(1U << c));
    EXPECT_EQ(others.outcome, PointOutcome::kSolved);
    EXPECT_LT((others.p - truth).norm(), 1e-8);
  }
}

TEST(Triangulate, GoodReadingsFailTheResidualTestAsOftenAsStated) {
  constexpr int kDraws = 20000;
  const Triangulator triangulator(ShippedRig(), {.residual_level = 0.01});
  const Eigen::Vector3d truth(-0.3, 0.5, 0.2);
  const std::vector<double> exact = Readings(ShippedRig(), truth), s(4, 0.02);
  Rng rng(6);
  std::size_t failed = 0;
  for (int i = 0; i < kDraws; ++i) {
    std::vector<double> u = exact;
    for (double& v : u) v += 0.02 * rng.Normal();
    failed += triangulator.Solve(u, s, truth).outcome == PointOutcome::kDisagree;
  }
  const auto [low, high] = BinomialInterval(failed, kDraws, 0.9999);
  EXPECT_LT(low, 0.01);
  EXPECT_GT(high, 0.01);
}

TEST(Triangulate, ParallelPlanesAreUnsolvable) {
  // Cameras turned until all lens axes are parallel: nothing tells where along them a point is.
  data::Lab lab = ShippedLab();
  for (data::LabCamera& camera : lab.cameras) {
    camera.position = {camera.position.x(), 0.3 * camera.position.y(), 2.8};
    camera.roll = 0.5 * M_PI;
  }
  lab.mounting = {};
  const VirtualRig truth = MakeVirtualRig(lab);
  data::Rig rig;
  for (const LensCamera& camera : truth.cameras) {
    data::RigCamera c;
    c.name = camera.name;
    c.R_CW = camera.X_WC.linear().transpose();
    // Exactly parallel: the lens axis is W's y.
    const Eigen::Vector3d Y = Eigen::Vector3d::UnitY();
    Eigen::Vector3d Z = camera.X_WC.linear().col(2);
    Z = (Z - Z.dot(Y) * Y).normalized();
    c.R_CW.row(0) = Y.cross(Z);
    c.R_CW.row(1) = Y;
    c.R_CW.row(2) = Z;
    c.p_WC = camera.X_WC.translation();
    c.f_px = 2234.0;
    c.u0_px = 1079.5;
    rig.cameras.push_back(c);
  }
  rig.volume_low = lab.volume_low;
  rig.volume_high = lab.volume_high;
  rig.covariance = Eigen::MatrixXd::Zero(4 * data::kCameraParameters, 4 * data::kCameraParameters);
  const Triangulator triangulator(rig);
  Rng rng(2);
  for (int i = 0; i < 50; ++i) {
    std::vector<double> u = Readings(rig, {rng.Uniform(-1, 1), rng.Uniform(-1, 1), 0.3});
    for (double& v : u) v += 0.02 * rng.Normal();
    const PointSolution point =
        triangulator.Solve(u, std::vector<double>(4, 0.02), triangulator.centre());
    EXPECT_EQ(point.outcome, PointOutcome::kParallel) << Name(point.outcome);
  }
}

TEST(Triangulate, TooFewReadingsAndPointsFarOutside) {
  const Triangulator triangulator(ShippedRig());
  const std::vector<double> s(4, 0.02);
  std::vector<double> u = Readings(ShippedRig(), {0.1, 0.2, 0.3});
  u[0] = u[2] = kNone;
  EXPECT_EQ(triangulator.Solve(u, s, triangulator.centre()).outcome, PointOutcome::kTooFew);
  u = Readings(ShippedRig(), {0.0, 0.0, -4.0});
  EXPECT_EQ(triangulator.Solve(u, s, triangulator.centre()).outcome, PointOutcome::kOutside);
}

}  // namespace
}  // namespace unfurl::measure::triangulate_test
