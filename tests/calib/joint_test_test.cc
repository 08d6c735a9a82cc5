#include "calib/joint_test.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "base/random.h"
#include "base/statistics.h"

namespace unfurl::calib::joint_test_test {
namespace {

constexpr Eigen::Index kData = 24;

Eigen::MatrixXd Draw(Eigen::Index rows, Eigen::Index columns, Rng* rng) {
  Eigen::MatrixXd out(rows, columns);
  for (double& x : out.reshaped()) x = rng->Normal();
  return out;
}

// A covariance as one group.
GroupedCovariance Dense(const Eigen::MatrixXd& C) { return {{C}, Eigen::MatrixXd(C.rows(), 0)}; }

struct World {
  Eigen::MatrixXd root, C, shapes;
  explicit World(Rng* rng) : root(0.1 * Draw(kData, kData, rng)) {
    root += Eigen::MatrixXd::Identity(kData, kData);
    C = root * root.transpose();
    shapes = Draw(kData, 4, rng);
  }
  Eigen::VectorXd Noise(Rng* rng) const { return root * Draw(kData, 1, rng); }
};

// The p-value is below p in a share p of the draws, were nothing wrong; never much above, for the
// tests that are made together are not independent.
TEST(JointTest, PValuesAreWhatTheySay) {
  Rng rng(5);
  const World world(&rng);
  constexpr int kDraws = 4000;
  int scan = 0, whole = 0;
  for (int k = 0; k < kDraws; ++k) {
    const JointTest test(world.Noise(&rng), Dense(world.C));
    scan += test.ScanChance(world.shapes) < 0.05 ? 1 : 0;
    whole += test.Chance() < 0.05 ? 1 : 0;
  }
  const double sigma = std::sqrt(0.05 * 0.95 * kDraws);
  EXPECT_NEAR(whole, 0.05 * kDraws, 4.0 * sigma);
  EXPECT_LT(scan, 0.05 * kDraws + 4.0 * sigma);
  EXPECT_GT(scan, 0.03 * kDraws);
}

// Leaving data free is leaving them out: against the chi-square of the rest, from its own block of
// the covariance.
TEST(JointTest, FreeDataAreLeftOut) {
  Rng rng(6);
  const World world(&rng);
  const Eigen::VectorXd e = world.Noise(&rng);
  const Effect free{0, Eigen::MatrixXd::Identity(5, 5)};
  const Eigen::Index rest = kData - 5;
  const Eigen::VectorXd tail = e.tail(rest);
  const double square = tail.dot(world.C.bottomRightCorner(rest, rest).ldlt().solve(tail));
  const double expected = ChiSquareTail(square, static_cast<double>(rest));
  const JointTest test(e, Dense(world.C));
  EXPECT_NEAR(test.ChanceWithoutAll({&free}), expected, 1e-9);
  EXPECT_NEAR(test.ChancesWithout({free})[0], expected, 1e-9);
}

// The amount is unbiased, scatters as it says, and the shift that is said to show is found nine
// times in ten.
TEST(JointTest, AmountsScatterAsTheySay) {
  Rng rng(7);
  const World world(&rng);
  const Eigen::VectorXd shape = world.shapes.col(2);
  constexpr int kDraws = 2000;
  double sum = 0.0, squares = 0.0, found = 0.0, named = 0.0;
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::VectorXd noise = world.Noise(&rng);
    const JointTest quiet(noise, Dense(world.C));
    const double amount = quiet.ShownAmount(world.shapes, 2, 0.01);
    const JointTest test(noise + amount * shape, Dense(world.C));
    const JointTest::Amount got = test.AmountOf({0, shape});
    sum += (got.value - amount) / got.sigma;
    squares += std::pow((got.value - amount) / got.sigma, 2);
    found += test.ScanChance(world.shapes) < 0.01 ? 1.0 : 0.0;
    Eigen::Index best = 0;
    double most = 0.0;
    for (Eigen::Index j = 0; j < 4; ++j) {
      const auto other = test.AmountOf({0, world.shapes.col(j)});
      if (std::abs(other.value) > most * other.sigma) {
        most = std::abs(other.value) / other.sigma;
        best = j;
      }
    }
    named += best == 2 ? 1.0 : 0.0;
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 4.0 / std::sqrt(kDraws));
  EXPECT_NEAR(squares / kDraws, 1.0, 4.0 * std::sqrt(2.0 / kDraws));
  EXPECT_GT(found / kDraws, 0.87);
  EXPECT_GT(named / kDraws, 0.87);
}

// Probabilities of causes, against evidence from the dense covariances: of misfits that an effect E
// of size t widens to C + t^2 E E^T, t as likely in each octave from where it shows as one sigma.
TEST(JointTest, ProbabilitiesAreThoseOfTheDenseEvidence) {
  Rng rng(9);
  const World world(&rng);
  const double high[] = {3.0, 40.0, 0.5};
  const double odds[] = {0.05, 0.2, 1.0};
  std::vector<Hypothesis> all;
  for (int j = 0; j < 3; ++j) {
    const Eigen::MatrixXd effect = j == 1 ? Eigen::MatrixXd(world.shapes.middleCols(1, 2))
                                          : Eigen::MatrixXd(world.shapes.col(j == 0 ? 0 : 3));
    all.push_back({CauseKind::kCamera, j, {0, effect}, high[j], odds[j]});
  }
  const Eigen::VectorXd e =
      world.Noise(&rng) + 0.6 * world.shapes.col(0) + 0.5 * world.shapes.col(2);
  const auto log_density = [&](const Eigen::MatrixXd& C) {
    const Eigen::LLT<Eigen::MatrixXd> llt(C);
    const Eigen::VectorXd white = llt.matrixL().solve(e);
    return -0.5 * white.squaredNorm() -
           Eigen::MatrixXd(llt.matrixL()).diagonal().array().log().sum();
  };
  std::vector<double> weight;
  for (const Hypothesis& one : all) {
    const Eigen::MatrixXd& E = one.effect.rows;
    const Eigen::MatrixXd information = E.transpose() * world.C.ldlt().solve(E);
    const double first =
        1.0 /
        std::sqrt(
            Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(information).eigenvalues().maxCoeff());
    double sum = 0.0, count = 0.0;
    for (double t = first; t < 2.0 * one.high; t *= 2.0, count += 1.0) {
      sum += std::exp(log_density(world.C + t * t * E * E.transpose()) - log_density(world.C));
    }
    weight.push_back(one.odds * sum / count);
  }
  const double total = weight[0] + weight[1] + weight[2];
  std::vector<double> expected;
  for (const double w : weight) expected.push_back(w / total);
  bool explained = false;
  const FoundCause found = JointTest(e, Dense(world.C)).FindCauses(all, 1.0, 1, &explained)[0];
  EXPECT_NEAR(found.probability, expected[static_cast<std::size_t>(found.index)], 1e-9);
  EXPECT_NEAR(found.other_probability, expected[static_cast<std::size_t>(found.other_index)], 1e-9);
  EXPECT_GT(found.other_probability, 0.01);  // else there is nothing to compare
}

// Two things wrong at once, of different kinds.
TEST(JointTest, CausesAreFoundOneAfterTheOther) {
  Rng rng(8);
  const World world(&rng);
  std::vector<Hypothesis> all;
  for (int j = 0; j < 4; ++j) {
    all.push_back({CauseKind::kCamera, j, {0, world.shapes.col(j)}, 1e4, 0.05});
  }
  for (int r = 0; r < kData; ++r) {
    all.push_back({CauseKind::kReading, r, {r, Eigen::MatrixXd::Ones(1, 1)}, 1e4, 0.01});
  }
  const Eigen::VectorXd e =
      world.Noise(&rng) + 30.0 * world.shapes.col(1) + 100.0 * Eigen::VectorXd::Unit(kData, 7);
  bool explained = false;
  const auto found = JointTest(e, Dense(world.C)).FindCauses(all, 0.01, 3, &explained);
  EXPECT_TRUE(explained);
  ASSERT_EQ(found.size(), 2U);
  const bool camera_first = found[0].kind == CauseKind::kCamera;
  const FoundCause &camera = found[camera_first ? 0 : 1], &reading = found[camera_first ? 1 : 0];
  EXPECT_EQ(camera.kind, CauseKind::kCamera);
  EXPECT_EQ(camera.index, 1);
  EXPECT_EQ(reading.kind, CauseKind::kReading);
  EXPECT_EQ(reading.index, 7);
}

// Two cameras whose sum is nearly what a third does, which explains most and not enough: with it
// first, three would be named, or none.
TEST(JointTest, TwoThatLookLikeAThirdAreNamed) {
  Rng rng(10);
  const Eigen::MatrixXd half = Eigen::MatrixXd::Identity(kData / 2, kData / 2);
  for (int draw = 0; draw < 20; ++draw) {
    World world(&rng);
    world.shapes.col(2) = world.shapes.col(0) - world.shapes.col(1) + 0.2 * Draw(kData, 1, &rng);
    std::vector<Hypothesis> all;
    for (int j = 0; j < 4; ++j) {
      all.push_back({CauseKind::kCamera, j, {0, world.shapes.col(j)}, 1e4, 0.05});
    }
    const Eigen::VectorXd e =
        Draw(kData, 1, &rng) + 300.0 * (world.shapes.col(0) - world.shapes.col(1));
    const JointTest test(e, {{half, half}, Eigen::MatrixXd(kData, 0)});
    bool explained = false;
    const auto found = test.FindCauses(all, 0.001, 3, &explained);
    EXPECT_TRUE(explained);
    ASSERT_EQ(found.size(), 2U) << draw;
    EXPECT_EQ(found[0].index + found[1].index, 1) << draw;
    for (const FoundCause& one : found) {
      EXPECT_GT(one.probability, 0.99);
      const double sign = one.index == 0 ? 1.0 : -1.0;
      const std::vector<FoundCause> other = {found[one.index == found[0].index ? 1 : 0]};
      const auto amount = test.AmountOf(all[one.hypothesis].effect, test.Free(all, other));
      EXPECT_NEAR(amount.value, sign * 300.0, 5.0 * amount.sigma);
      EXPECT_NEAR(one.amount(0), sign * 300.0, 5.0 * amount.sigma);
    }
  }
}

// A gross reading among noise that is a little too large: what is named beside it was taken because
// it is enough, where a more probable one is not. Its probability is among those that are enough.
TEST(JointTest, NoCauseIsNamedWithoutProbability) {
  Rng rng(11);
  const Eigen::MatrixXd half = Eigen::MatrixXd::Identity(kData / 2, kData / 2);
  int beside = 0;
  for (int draw = 0; draw < 100; ++draw) {
    const Eigen::MatrixXd shapes = Draw(kData, 4, &rng);
    std::vector<Hypothesis> all;
    for (int j = 0; j < 4; ++j) {
      all.push_back({CauseKind::kCamera, j, {0, shapes.col(j)}, 1e4, 0.05});
    }
    for (int j = 0; j < 4; ++j) {
      Eigen::MatrixXd at_will = Draw(kData, 6, &rng);
      at_will.col(0) = shapes.col(j);
      all.push_back({CauseKind::kCamera, j, {0, at_will}, 1e4, 0.01});
    }
    for (int r = 0; r < kData; ++r) {
      all.push_back({CauseKind::kReading, r, {r, Eigen::MatrixXd::Ones(1, 1)}, 1e4, 0.01});
    }
    const Eigen::VectorXd e = 1.4 * Draw(kData, 1, &rng) + 100.0 * Eigen::VectorXd::Unit(kData, 7);
    const JointTest test(e, {{half, half}, Eigen::MatrixXd(kData, 0)});
    bool explained = false;
    const auto found = test.FindCauses(all, 0.01, 3, &explained);
    if (!explained) continue;
    for (const FoundCause& one : found) {
      beside += one.kind == CauseKind::kCamera ? 1 : 0;
      EXPECT_GT(one.probability, 0.05) << draw << ": " << Name(one.kind) << " " << one.index;
    }
  }
  EXPECT_GT(beside, 5);  // else there was nothing to see
}

}  // namespace
}  // namespace unfurl::calib::joint_test_test
