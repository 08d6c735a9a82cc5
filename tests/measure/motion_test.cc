// How marks move: the filters' closed forms, and what does not depend on which way time runs.

#include "measure/motion.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "base/random_vector.h"

namespace unfurl::measure::motion_test {
namespace {

const Eigen::Vector3d kPlace(0.3, -1.2, 0.7), kVelocity(1.5, 0.4, -0.8),
    kAcceleration(3.0, -6.0, 2.0);
constexpr double kVariance = 1e-8;  // of a sample's coordinate: 0.1 mm
constexpr double kStep = 5e-3;

Eigen::Vector3d Path(double t) { return kPlace + t * kVelocity + 0.5 * t * t * kAcceleration; }

// After one sample: what is known of speed (a quarter of the highest, 5 m/s) and acceleration (2.5
// of the highest, 500 m/s^2), and white jerk of density q, whose part of the place's variance after
// dt is q dt^5 / 20: in an interval the ways of moving reach so much of the 0.1 m that a mark can.
TEST(Motion, OneSampleSpreadsAsItsPriorsDo) {
  Motion motion;
  motion.Add(1.0, kPlace, kVariance);
  const double dt = 2e-3;
  const Motion::Prediction at = motion.Predict(1.0 + dt);
  ASSERT_EQ(at.count, 4U);
  const double moves[] = {4e-6, 4e-5, 4e-4, 0.013};  // [m] in 5 ms
  for (std::size_t j = 0; j < 4; ++j) {
    const double expected = kVariance + 25.0 * dt * dt + 250000.0 * std::pow(dt, 4) / 4.0 +
                            moves[j] * moves[j] * std::pow(dt / 5e-3, 5);
    EXPECT_NEAR(at.variance[j], expected, 1e-10 * expected) << j;
    EXPECT_LT((at.mean[j] - kPlace).norm(), 1e-14);
    EXPECT_NEAR(at.weight[j], 0.25, 1e-14);
  }
  // No further than a millimetre and 20 m/s.
  EXPECT_NEAR(motion.Predict(1.2).variance[3], std::pow(1e-3 + 20.0 * 0.2, 2), 1e-9);
}

// Position, velocity and acceleration are in the state: a parabola is followed.
TEST(Motion, AParabolaIsForetold) {
  Motion motion;
  for (int k = 0; k <= 40; ++k) motion.Add(kStep * k, Path(kStep * k), kVariance);
  const double t = 41 * kStep;
  const Motion::Prediction at = motion.Predict(t);
  EXPECT_LT((at.Likeliest() - Path(t)).norm(), 2e-4);
  EXPECT_EQ(at.LikeliestAt(), 0U);  // the calmest explains it best
  double sum = 0.0;
  for (std::size_t j = 0; j < at.count; ++j) sum += at.weight[j];
  EXPECT_NEAR(sum, 1.0, 1e-12);
  // A kick of 10 mm is the wildest's.
  Eigen::Vector3d kicked = Path(t);
  kicked.x() += 0.01;
  motion.Add(t, kicked, kVariance);
  EXPECT_EQ(motion.Predict(t + kStep).LikeliestAt(), 3U);
}

// From both sides of a gap: the same mixture whichever side is called the past, nearer to the truth
// than either.
TEST(Motion, BetweenDoesNotKnowTheDirectionOfTime) {
  Rng rng(3);
  Motion before, behind;
  for (int k = 0; k <= 20; ++k) {
    const double t = kStep * k, s = 0.16 - kStep * k + 20 * kStep;
    const Eigen::Vector3d noise = 1e-4 * NormalVector(&rng);
    before.Add(t, Path(t) + noise, kVariance);
    behind.Add(-s, Path(s) + 0.5 * noise, kVariance);
  }
  // Samples end at 0.1 s and begin again at 0.16 s.
  for (const double t : {0.11, 0.13, 0.15}) {
    const Motion::Prediction forward = before.Between(t, behind), back = behind.Between(-t, before);
    ASSERT_EQ(forward.count, back.count);
    EXPECT_LT((forward.Likeliest() - back.Likeliest()).norm(), 1e-9);
    EXPECT_LT((forward.Likeliest() - Path(t)).norm(), 1e-3);
    const double variance = forward.variance[forward.LikeliestAt()];
    EXPECT_NEAR(variance, back.variance[back.LikeliestAt()], 1e-6 * variance);
    EXPECT_LT(variance, before.Predict(t).variance[0]);
    EXPECT_LT(variance, behind.Predict(-t).variance[0]);
    EXPECT_LT((forward.Likeliest() - Path(t)).norm(), 5.0 * std::sqrt(3.0 * variance));
    // Jointly as likely from either side.
    const Eigen::Matrix3d cov = 1e-6 * Eigen::Matrix3d::Identity();
    for (const double off : {0.0, 1e-3, 5e-3}) {
      const Eigen::Vector3d p = Path(t) + Eigen::Vector3d(off, -off, 0.5 * off);
      EXPECT_NEAR(LogDensity(forward, p, cov), LogDensity(back, p, cov), 1e-5);
    }
  }
}

TEST(Motion, StraightOnWithinReachAndTooFast) {
  MotionOptions options;
  Motion motion(options);
  EXPECT_FALSE(motion.known());
  motion.Add(0.0, kPlace, kVariance);
  EXPECT_FALSE(motion.Fresh(0.001));
  motion.Add(0.01, kPlace + 0.01 * kVelocity, kVariance);
  EXPECT_TRUE(motion.Fresh(0.109));
  EXPECT_FALSE(motion.Fresh(0.111));
  EXPECT_FALSE(motion.Lost(0.109));
  EXPECT_TRUE(motion.Lost(0.111));
  EXPECT_LT((motion.Start(0.03) - (kPlace + 0.03 * kVelocity)).norm(), 1e-14);
  EXPECT_LT((motion.Start(0.2) - (kPlace + 0.01 * kVelocity)).norm(), 1e-14);  // no longer fresh
  // Half of 200 m/s^2 times 0.02 s (0.02 s + 0.01 s) is 60 mm, and five sigmas of 1 mm.
  const Eigen::Vector3d there = motion.Start(0.03), aside = kVelocity.unitOrthogonal();
  EXPECT_TRUE(motion.WithinReach(0.03, there + 0.0649 * aside, 1e-3));
  EXPECT_FALSE(motion.WithinReach(0.03, there + 0.0651 * aside, 1e-3));
  // 20 m/s for 0.02 s, and 10 mm.
  const Eigen::Vector3d last = kPlace + 0.01 * kVelocity;
  EXPECT_FALSE(motion.TooFast(0.03, last + 0.409 * aside));
  EXPECT_TRUE(motion.TooFast(0.03, last + 0.411 * aside));
}

// What was expected fades from the first line that should have shown it.
TEST(Motion, ExpectationsFade) {
  Motion motion;
  motion.Expect(kPlace, 0.02);
  EXPECT_TRUE(motion.known());
  motion.Begin(1.0);
  EXPECT_EQ(motion.Predict(0.5).count, 1U);
  EXPECT_NEAR(motion.Predict(0.5).variance[0], 0.02 * 0.02, 1e-15);
  EXPECT_NEAR(motion.Predict(1.1).variance[0], std::pow(0.02 + 0.1, 2), 1e-12);
  EXPECT_EQ(motion.Predict(1.1).mean[0], kPlace);
  EXPECT_FALSE(motion.Lost(1.0));
  EXPECT_TRUE(motion.Lost(1.01));
}

// A sum of two Gaussians, each of its own variance and the point's, written out.
TEST(LogDensity, IsThatOfTheMixture) {
  Motion::Prediction at;
  at.count = 2;
  at.mean[0] = kPlace;
  at.mean[1] = kPlace + 0.01 * kVelocity;
  at.variance[0] = 1e-4;
  at.variance[1] = 4e-4;
  at.weight[0] = 0.7;
  at.weight[1] = 0.3;
  Eigen::Matrix3d cov;
  cov << 2e-4, 5e-5, 0.0, 5e-5, 1e-4, -2e-5, 0.0, -2e-5, 3e-4;
  const Eigen::Vector3d p = kPlace + Eigen::Vector3d(0.01, 0.005, -0.02);
  double density = 0.0;
  for (std::size_t j = 0; j < 2; ++j) {
    const Eigen::Matrix3d S = cov + at.variance[j] * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d e = p - at.mean[j];
    density += at.weight[j] * std::exp(-0.5 * e.dot(S.fullPivLu().solve(e))) /
               std::sqrt(std::pow(2.0 * M_PI, 3) * S.determinant());
  }
  EXPECT_NEAR(LogDensity(at, p, cov), std::log(density), 1e-10);
  const double terms[] = {-1000.0, -1001.0};  // no underflow
  EXPECT_NEAR(LogSum(terms), -1000.0 + std::log(1.0 + std::exp(-1.0)), 1e-10);
}

}  // namespace
}  // namespace unfurl::measure::motion_test
