// What stretches of a record are worth to each other, against fits made without them.
#include "correlate/fit/held_out.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/dense.h"
#include "base/error.h"
#include "base/random.h"

namespace unfurl::correlate::held_out_test {
namespace {

struct Linear {
  Eigen::MatrixXd A;
  Eigen::VectorXd y;
  std::vector<int> stretch;

  // Rows of `stretches` stretches, then one of a prior.
  Linear(int each, int stretches, Eigen::Index unknowns, std::uint64_t seed) {
    Rng rng(seed);
    const Eigen::Index n = each * stretches + 1;
    A.resize(n, unknowns);
    y.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < unknowns; ++j) A(i, j) = rng.Normal();
      y(i) = rng.Normal();
      stretch.push_back(i + 1 < n ? static_cast<int>(i) / each : -1);
    }
  }
  // Residuals at some values of the unknowns.
  Eigen::VectorXd At(const Eigen::VectorXd& x) const { return y + A * x; }
};

// The same by a fit to the other rows and the dense covariance of what it predicts.
double ByHand(const Linear& problem, int k, double scale) {
  std::vector<Eigen::Index> own, others;
  for (Eigen::Index i = 0; i < problem.y.size(); ++i) {
    (problem.stretch[static_cast<std::size_t>(i)] == k ? own : others).push_back(i);
  }
  const Eigen::MatrixXd B = problem.A(others, Eigen::all), C = problem.A(own, Eigen::all);
  const Eigen::VectorXd x = B.colPivHouseholderQr().solve(Eigen::VectorXd(-problem.y(others)));
  const Eigen::VectorXd e = problem.y(own) + C * x;
  const auto n = static_cast<Eigen::Index>(own.size());
  const Eigen::MatrixXd S =
      scale * (Eigen::MatrixXd::Identity(n, n) + C * (B.transpose() * B).inverse() * C.transpose());
  return -0.5 * (static_cast<double>(n) * std::log(2.0 * std::numbers::pi) +
                 std::log(S.determinant()) + e.dot(S.inverse() * e));
}

TEST(HeldOut, IsWhatFitsToTheOthersPredict) {
  const Linear problem(7, 5, 4, 1);
  const Eigen::VectorXd best = problem.A.colPivHouseholderQr().solve(Eigen::VectorXd(-problem.y));
  // About the minimum, and about a place that is none: the model is linear.
  for (const double away : {0.0, 0.3}) {
    const Eigen::VectorXd x = best.array() + away;
    const HeldOut found = PredictHeldOut(problem.At(x), problem.A, problem.stretch, 1.7);
    ASSERT_EQ(found.score.size(), 5U);
    for (int k = 0; k < 5; ++k) {
      EXPECT_NEAR(found.score[static_cast<std::size_t>(k)], ByHand(problem, k, 1.7), 1e-9);
      EXPECT_EQ(found.rows[static_cast<std::size_t>(k)], 7U);
    }
  }
}

// What one stretch alone determines, the others cannot predict.
TEST(HeldOut, AStretchThatStandsAloneIsNotScored) {
  Linear problem(6, 3, 2, 2);
  for (Eigen::Index i = 6; i < problem.y.size(); ++i) problem.A(i, 1) = 0.0;
  const HeldOut found = PredictHeldOut(problem.y, problem.A, problem.stretch, 1.0);
  EXPECT_TRUE(std::isnan(found.score[0]));
  EXPECT_FALSE(std::isnan(found.score[1]));
  // An unknown that no row knows is none.
  Eigen::MatrixXd wider(problem.A.rows(), 3);
  wider << problem.A, Eigen::VectorXd::Zero(problem.A.rows());
  const HeldOut same = PredictHeldOut(problem.y, wider, problem.stretch, 1.0);
  EXPECT_NEAR(same.score[1], found.score[1], 1e-9);
}

// The gain of a law that is in the data is the one that its likelihood has, and of one that is not,
// none: over many records the standard error holds what scatters.
TEST(HeldOut, TheGainsErrorHoldsItsScatter) {
  constexpr int kRecords = 400, kStretches = 8, kEach = 25;
  double sum = 0.0, squares = 0.0, predicted = 0.0;
  for (int record = 0; record < kRecords; ++record) {
    Rng rng(static_cast<std::uint64_t>(record) + 1);
    const Eigen::Index n = kStretches * kEach;
    Eigen::MatrixXd both(n, 2);
    Eigen::VectorXd y(n);
    std::vector<int> stretch;
    for (Eigen::Index i = 0; i < n; ++i) {
      both(i, 0) = rng.Normal();
      both(i, 1) = rng.Normal();
      y(i) = -0.5 * both(i, 1) + rng.Normal();
      stretch.push_back(static_cast<int>(i) / kEach);
    }
    auto score = [&](Eigen::Index columns) {
      const Eigen::MatrixXd A = both.leftCols(columns);
      const Eigen::VectorXd x = A.colPivHouseholderQr().solve(Eigen::VectorXd(-y));
      return PredictHeldOut(y + A * x, A, stretch, 1.0);
    };
    const PredictiveGain gain = CompareHeldOut(score(2), score(1));
    EXPECT_EQ(gain.stretches, kStretches);
    sum += gain.gain;
    squares += gain.gain * gain.gain;
    predicted += gain.sigma * gain.sigma;
  }
  const double mean = sum / kRecords;
  const double scatter = std::sqrt(squares / kRecords - mean * mean);
  // n b^2 / 2 less half a nat for the coefficient that is not known.
  EXPECT_NEAR(mean, 0.5 * kStretches * kEach * 0.25 - 0.5, 1.0);
  // 400 records know a scatter to 3.5%, eight stretches its square to half of it each time.
  EXPECT_NEAR(std::sqrt(predicted / kRecords) / scatter, 1.0, 0.15);
}

// Without gravity a pendulum hangs still, and its damping does nothing: what is predicted is the
// model as it is, and so without any unknown.
TEST(HeldOut, UnknownsThatDoNothingLeaveTheModelAsItIs) {
  const Eigen::VectorXd r = Eigen::VectorXd::Constant(6, 0.5);
  const double scale = 2.0;
  const double each = -0.5 * (std::log(2.0 * std::numbers::pi * scale) + 0.25 / scale);
  for (const Eigen::Index unknowns : {0, 2}) {
    const HeldOut scored =
        PredictHeldOut(r, Eigen::MatrixXd::Zero(6, unknowns), {0, 0, 1, 1, 1, 1}, scale);
    ASSERT_EQ(scored.score.size(), 2U);
    EXPECT_NEAR(scored.score[0], 2.0 * each, 1e-12);
    EXPECT_NEAR(scored.score[1], 4.0 * each, 1e-12);
    EXPECT_EQ(scored.rows, (std::vector<std::size_t>{2, 4}));
  }
}

TEST(HeldOut, UnlikeRecordsAreRefused) {
  HeldOut a, b;
  a.score = {1.0};
  EXPECT_THROW(CompareHeldOut(a, b), Error);
  // Stretches of which one has other rows are left out.
  a.score = b.score = {1.0, 2.0};
  a.rows = {3, 4};
  b.rows = {3, 5};
  EXPECT_EQ(CompareHeldOut(a, b).stretches, 1);
}

}  // namespace
}  // namespace unfurl::correlate::held_out_test
