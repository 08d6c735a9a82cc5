#include "base/pose.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random_vector.h"

namespace unfurl::pose_test {
namespace {

constexpr double kRoundOff = 1e-13;  // some tens of operations on numbers of order one

TEST(Pose, RotationVectorsGoThereAndBack) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    Eigen::Vector3d w = NormalVector(&rng);
    w *= rng.Uniform(0.0, 3.0) / w.norm();
    EXPECT_LT((VectorFromRotation(RotationFromVector(w)) - w).norm(), 1e-11) << w.transpose();
  }
  EXPECT_LT((RotationFromVector(Eigen::Vector3d::Zero()) - Eigen::Matrix3d::Identity()).norm(),
            kRoundOff);
}

TEST(Pose, SkewIsTheCrossProduct) {
  const Eigen::Vector3d a(1, 2, 3), b(-4, 5, 0.5);
  EXPECT_LT((Skew(a) * b - a.cross(b)).norm(), kRoundOff);
}

TEST(FitRigid, FindsThePoseThatMadeThePoints) {
  Rng rng(2);
  for (int repeat = 0; repeat < 20; ++repeat) {
    Pose X = Pose::Identity();
    X.linear() = RotationFromVector({rng.Normal(), rng.Normal(), rng.Normal()});
    X.translation() << rng.Normal(), rng.Normal(), rng.Normal();
    Eigen::Matrix3Xd p_B(3, 4);
    for (int i = 0; i < 12; ++i) p_B(i % 3, i / 3) = rng.Normal();
    const RigidFit fit = FitRigid(X * p_B, p_B);
    EXPECT_LT((fit.X_AB.matrix() - X.matrix()).norm(), 1e-12);
    EXPECT_LT(fit.rms, 1e-12);
    EXPECT_FALSE(fit.rank_deficient);
  }
}

TEST(FitRigid, NeverMirrors) {
  Eigen::Matrix3Xd p_B = Eigen::Matrix3Xd::Random(3, 6);
  Eigen::Matrix3Xd mirrored = p_B;
  mirrored.row(0) *= -1.0;
  EXPECT_NEAR(FitRigid(mirrored, p_B).X_AB.linear().determinant(), 1.0, kRoundOff);
}

TEST(FitRigid, SaysThatCollinearPointsLeaveATurnFree) {
  Eigen::Matrix3Xd line(3, 5);
  for (int i = 0; i < 5; ++i) line.col(i) = Eigen::Vector3d(0.1, 0.2, 0.3) * i;
  EXPECT_TRUE(FitRigid(line, line).rank_deficient);
}

TEST(FitRigid, AWeightOfZeroLeavesAPointOut) {
  Eigen::Matrix3Xd p = Eigen::Matrix3Xd::Random(3, 5);
  Eigen::Matrix3Xd q = p;
  q.col(2) += Eigen::Vector3d(5, 5, 5);
  Eigen::VectorXd w = Eigen::VectorXd::Ones(5);
  w(2) = 0.0;
  EXPECT_LT((FitRigid(q, p, w).X_AB.matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
}

}  // namespace
}  // namespace unfurl::pose_test
