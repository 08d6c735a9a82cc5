// Steps within bounds, against every set of bounds that could hold.
#include "correlate/fit/bounded_step.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "correlate/fit/solver.h"

namespace unfurl::correlate::bounded_step_test {
namespace {

double Rise(const Eigen::MatrixXd& normal, const Eigen::VectorXd& slope, const Eigen::VectorXd& s) {
  return 2.0 * slope.dot(s) + s.dot(normal * s);
}

// The lowest of the lowest points with each unknown free, at its low or at its high bound.
double LowestOfAll(const Eigen::MatrixXd& normal, const Eigen::VectorXd& slope,
                   const Eigen::VectorXd& low, const Eigen::VectorXd& high) {
  const Eigen::Index n = slope.size();
  double best = 0.0;
  for (int code = 0; code < std::lround(std::pow(3, n)); ++code) {
    Eigen::VectorXd s = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Index> free;
    int rest = code;
    for (Eigen::Index j = 0; j < n; ++j, rest /= 3) {
      if (rest % 3 == 0) free.push_back(j);
      if (rest % 3 == 1) s(j) = low(j);
      if (rest % 3 == 2) s(j) = high(j);
    }
    if (!free.empty()) {
      const Eigen::VectorXd held = slope + normal * s;
      const Eigen::MatrixXd H = normal(free, free);
      s(free) = -H.ldlt().solve(Eigen::VectorXd(held(free)));
    }
    const bool inside = (s.array() >= low.array()).all() && (s.array() <= high.array()).all();
    if (inside && s.allFinite()) best = std::min(best, Rise(normal, slope, s));
  }
  return best;
}

TEST(BoundedStep, IsTheLowestWithinItsBounds) {
  constexpr Eigen::Index kUnknowns = 5;
  Rng rng(4);
  for (int repeat = 0; repeat < 200; ++repeat) {
    Eigen::MatrixXd J(8, kUnknowns);
    for (double& x : J.reshaped()) x = rng.Normal();
    if (repeat % 2 == 0) J.col(1) = J.col(0) + 1e-2 * J.col(1);  // two that do nearly the same
    Eigen::VectorXd r(8), low(kUnknowns), high(kUnknowns);
    for (double& x : r) x = rng.Normal();
    for (double& x : low) x = rng.Uniform() < 0.3 ? 0.0 : -rng.Uniform();
    for (double& x : high) x = rng.Uniform();
    // A mass in kilograms, a damping in nanonewton seconds: units decide nothing.
    Eigen::VectorXd unit(kUnknowns);
    for (double& x : unit) x = std::pow(10.0, std::floor(20.0 * rng.Uniform()) - 10.0);
    const Eigen::MatrixXd normal = J.transpose() * J;
    const Eigen::VectorXd slope = J.transpose() * r;
    const Eigen::VectorXd found =
        BoundedStep(unit.asDiagonal() * normal * unit.asDiagonal(), unit.cwiseProduct(slope),
                    low.cwiseQuotient(unit), high.cwiseQuotient(unit));
    const Eigen::VectorXd s = unit.cwiseProduct(found);
    EXPECT_TRUE((s.array() >= low.array() - 1e-12).all());
    EXPECT_TRUE((s.array() <= high.array() + 1e-12).all());
    const double best = LowestOfAll(normal, slope, low, high);
    EXPECT_NEAR(Rise(normal, slope, s), best, 1e-7 * std::abs(best)) << repeat;
  }
}

TEST(BoundedStep, WhatNothingDecidesStays) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const Eigen::Matrix2d normal{{4.0, 0.0}, {0.0, 0.0}};
  const Eigen::Vector2d slope(-8.0, 0.0), far(kFar, kFar);
  const Eigen::VectorXd s = BoundedStep(normal, slope, -far, far);
  EXPECT_DOUBLE_EQ(s(0), 2.0);
  EXPECT_EQ(s(1), 0.0);
}

// A stiffness in N/m beside the logarithm of a damping: 1e9 of one move as much as 1 of the other.
TEST(StepAndSigma, UnitsDecideNothing) {
  Rng rng(5);
  Eigen::MatrixXd J(12, 3);
  for (double& x : J.reshaped()) x = rng.Normal();
  Eigen::VectorXd r(12);
  for (double& x : r) x = rng.Normal();
  const Eigen::Vector3d unit(1e-9, 1.0, 1e9);
  const GaussNewton plain = StepAndSigma(J, r), other = StepAndSigma(J * unit.asDiagonal(), r);
  for (Eigen::Index j = 0; j < 3; ++j) {
    EXPECT_NEAR(unit(j) * other.step(j), plain.step(j), 1e-9);
    EXPECT_NEAR(unit(j) * other.sigma(j), plain.sigma(j), 1e-9);
  }
}

}  // namespace
}  // namespace unfurl::correlate::bounded_step_test
