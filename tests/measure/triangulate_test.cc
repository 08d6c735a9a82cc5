#include "measure/triangulate.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/statistics.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// The shipped layout as a rig of two-centre cameras; what it is a model of does not matter here.
const data::Rig& ShippedRig() {
  static const data::Rig rig = [] {
    const data::Lab lab = ShippedLab();
    return FitRig(MakeVirtualRig(lab), lab.volume_low, lab.volume_high);
  }();
  return rig;
}

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
  rig.covariance = Eigen::MatrixXd::Zero(76, 76);
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

TEST(CameraBank, IsTheCameraModelForAllCamerasAtOnce) {
  constexpr double kRoundOff = 1e-12;  // relative
  data::Rig rig = ShippedRig();
  Rng rng(3);
  for (data::RigCamera& camera : rig.cameras) {
    for (double& term : camera.terms_px) term += rng.Uniform(-30.0, 30.0);
  }
  const CameraBank bank(rig.cameras);
  const Eigen::Matrix3Xd points = RandomPoints(rig.volume_low, rig.volume_high, 50, 5);
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d p = points.col(i);
    std::vector<double> u(bank.lanes(), 0.0), w(bank.lanes(), 0.0), seen(bank.lanes());
    Eigen::Matrix3d JwJ = Eigen::Matrix3d::Zero();
    Eigen::Vector3d Jwr = Eigen::Vector3d::Zero();
    double chi_square = 0.0;
    bank.Readings(p.data(), seen.data());
    for (std::size_t c = 0; c < 4; ++c) {
      Projection here;
      ASSERT_TRUE(Project(rig.cameras[c], p, &here));
      EXPECT_NEAR(seen[c], here.u_px, kRoundOff * 2000.0);
      u[c] = here.u_px + rng.Uniform(-5.0, 5.0);
      w[c] = c == 2 ? 0.0 : rng.Uniform(1.0, 2000.0);
      JwJ += w[c] * here.du_dp.transpose() * here.du_dp;
      Jwr += w[c] * (u[c] - here.u_px) * here.du_dp.transpose();
      chi_square += w[c] * (u[c] - here.u_px) * (u[c] - here.u_px);
    }
    CameraBank::Sums sums;
    bank.Accumulate(p.data(), u.data(), w.data(), &sums);
    const double scale = JwJ.trace();
    EXPECT_NEAR(sums.JwJ[0], JwJ(0, 0), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[1], JwJ(0, 1), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[2], JwJ(0, 2), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[3], JwJ(1, 1), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[4], JwJ(1, 2), kRoundOff * scale);
    EXPECT_NEAR(sums.JwJ[5], JwJ(2, 2), kRoundOff * scale);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(sums.Jwr[k], Jwr(k), kRoundOff * 10.0 * scale);
    EXPECT_NEAR(sums.chi_square, chi_square, 1e-9 * chi_square);
    EXPECT_TRUE(sums.in_front);
  }
  CameraBank::Sums sums;
  const std::vector<double> u(bank.lanes(), 0.0);
  std::vector<double> w(bank.lanes(), 1.0);
  const Eigen::Vector3d behind = rig.cameras[1].p_WC + Eigen::Vector3d(0.0, 0.0, 1.0);
  bank.Accumulate(behind.data(), u.data(), w.data(), &sums);
  EXPECT_FALSE(sums.in_front);
}

// Cameras anywhere on a shell around the volume, looking at it, lens axes at any angle.
data::Rig ShellRig(Rng& rng) {
  data::Rig rig = ShippedRig();
  for (data::RigCamera& camera : rig.cameras) {
    Eigen::Vector3d from(rng.Normal(), rng.Normal(), rng.Normal());
    from *= rng.Uniform(2.8, 3.6) / from.norm();
    const Eigen::Vector3d Z = -from.normalized();
    const Eigen::Vector3d any(rng.Normal(), rng.Normal(), rng.Normal());
    const Eigen::Vector3d X = (any - any.dot(Z) * Z).normalized();
    camera.p_WC = from;
    camera.R_CW.row(0) = X.transpose();
    camera.R_CW.row(1) = Z.cross(X).transpose();
    camera.R_CW.row(2) = Z.transpose();
  }
  return rig;
}

// Counts points whose three readings have a second solution by brute force (Newton's method from 27
// places), and those of them that SecondSolution does not tell of.
void CompareSecondSolutions(const data::Rig& rig, const Eigen::Matrix3Xd& points,
                            const TriangulateOptions& options, std::size_t* with_second,
                            std::size_t* missed) {
  const Triangulator triangulator(rig, options);
  const std::vector<double> s(4, 0.02);
  const Eigen::Vector3d size = rig.volume_high - rig.volume_low;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d truth = points.col(i);
    const std::vector<double> u = Readings(rig, truth);
    for (int missing = 0; missing < 4; ++missing) {
      const std::uint32_t use = 0xFU & ~(1U << missing);
      const PointSolution first = triangulator.Solve(u, s, truth, use);
      if (first.outcome != PointOutcome::kSolved) continue;  // near-parallel
      bool second = false;
      for (int k = 0; k < 27 && !second; ++k) {
        const Eigen::Vector3d at(k % 3, k / 3 % 3, k / 9);
        const PointSolution found =
            triangulator.Solve(u, s, rig.volume_low + 0.5 * size.cwiseProduct(at), use);
        second = found.outcome == PointOutcome::kSolved && (found.p - truth).norm() > 1e-3 &&
                 triangulator.NearVolume(found.p);
      }
      PointSolution twin;
      const bool told = triangulator.SecondSolution(u, s, first, &twin);
      *with_second += second;
      *missed += second && !told;
      if (!told) continue;
      // What is told is a true solution, another one.
      EXPECT_GT((twin.p - truth).norm(), 1e-5);
      for (std::size_t c = 0; c < 4; ++c) {
        if ((use >> c & 1U) == 0) continue;
        double at_twin = 0.0;
        ASSERT_TRUE(Project(rig.cameras[c], twin.p, &at_twin));
        EXPECT_NEAR(at_twin, u[c], 1e-6);
      }
    }
  }
}

TEST(Triangulate, BothPointsThatFitThreeReadingsAreFound) {
  // Glass bends the surfaces by millimetres, and then a second point is metres away; here they bend
  // a hundred times as much. What the parabola misses are curves that bend the other way before
  // they return.
  constexpr double kMissed = 0.02;
  Rng rng(15);
  std::size_t with_second = 0, missed = 0, shipped = 0, shipped_missed = 0;
  CompareSecondSolutions(ShippedRig(),
                         RandomPoints(ShippedRig().volume_low, ShippedRig().volume_high, 200, 15),
                         {.twin_margin = 0.5}, &shipped, &shipped_missed);
  for (int r = 0; r < 60; ++r) {
    data::Rig rig = ShellRig(rng);
    for (data::RigCamera& camera : rig.cameras) {
      for (std::size_t k = 5; k < 8; ++k) camera.terms_px[k] = rng.Uniform(-800.0, 800.0);
    }
    CompareSecondSolutions(rig, RandomPoints(rig.volume_low, rig.volume_high, 20, 15), {},
                           &with_second, &missed);
  }
  std::printf(
      "second solutions: shipped rig %zu of 800 (missed %zu), any rig %zu of 4800 (missed %zu)\n",
      shipped, shipped_missed, with_second, missed);
  EXPECT_EQ(shipped, 0U);  // with the glass of the shipped set there is none
  EXPECT_GT(with_second, 20U);
  EXPECT_LE(static_cast<double>(missed), kMissed * static_cast<double>(with_second));
}

TEST(Triangulate, PointsReachTheBoundOnFiveHundredRigs) {
  // Cameras anywhere on a shell around the volume, looking at it, lens axes at any angle; points
  // are scattered by Gaussian readings of the rig's own model. The bound is the Fisher matrix at
  // the truth. A rig or point that the options refuse is drawn again.
  constexpr int kRigs = 500, kPoints = 20;
  constexpr double kLimit = 1.1;  // of the bound
  Rng rng(77);
  double squared = 0.0, bound = 0.0, worst = 0.0;
  int points = 0, refused = 0;
  for (int r = 0; r < kRigs; ++r) {
    const data::Rig rig = ShellRig(rng);
    const Triangulator triangulator(rig);
    double rig_squared = 0.0, rig_bound = 0.0;
    for (int i = 0; i < kPoints; ++i) {
      const Eigen::Vector3d truth(rng.Uniform(-1.0, 1.0), rng.Uniform(-1.0, 1.0),
                                  rng.Uniform(-1.0, 1.0));
      std::vector<double> u = Readings(rig, truth), s(4);
      Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
      for (std::size_t c = 0; c < 4; ++c) {
        s[c] = rng.Uniform(0.01, 0.06);
        Projection here;
        Project(rig.cameras[c], truth, &here);
        information += here.du_dp.transpose() * here.du_dp / (s[c] * s[c]);
        u[c] += s[c] * rng.Normal();
      }
      const PointSolution point = triangulator.Solve(u, s, triangulator.centre());
      if (point.outcome != PointOutcome::kSolved || (point.p - truth).norm() > 0.05) {
        // Never a wild point: what is called solved is the point.
        EXPECT_NE(point.outcome, PointOutcome::kSolved) << (point.p - truth).norm();
        ++refused;
        continue;
      }
      const Eigen::Matrix3d cramer_rao = information.inverse();
      rig_squared += (point.p - truth).squaredNorm() / cramer_rao.trace();
      rig_bound += 1.0;
      squared += (point.p - truth).squaredNorm() / cramer_rao.trace();
      bound += 1.0;
      ++points;
    }
    if (rig_bound > 0.0) worst = std::max(worst, std::sqrt(rig_squared / rig_bound));
  }
  std::printf("points over the bound: %.4f (%d points, %d refused)\n", std::sqrt(squared / bound),
              points, refused);
  EXPECT_GT(points, kRigs * kPoints * 7 / 10);
  EXPECT_LT(std::sqrt(squared / bound), kLimit);
  EXPECT_GT(std::sqrt(squared / bound), 0.9);  // below the bound something would be wrong
}

}  // namespace
}  // namespace unfurl::measure
