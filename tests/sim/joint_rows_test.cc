#include "sim/constraints/joint_rows.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/random.h"

namespace unfurl::sim::joint_rows_test {
namespace {

constexpr int kBodies = 3;
// Central differences with this step: error of about step^2 and 1e-16 / step.
constexpr double kStep = 1e-5;
constexpr double kFirst = 1e-9, kSecond = 3e-5;

struct State {
  std::array<double, kBodies> x{}, y{}, theta{}, vx{}, vy{}, omega{}, c{}, s{};
  double t = 0.0;
  Motion At() {
    for (int k = 0; k < kBodies; ++k) {
      c[k] = std::cos(theta[k]);
      s[k] = std::sin(theta[k]);
    }
    return {t,         x.data(),     y.data(), theta.data(), vx.data(),
            vy.data(), omega.data(), c.data(), s.data()};
  }
  // Moved for a time h with constant velocities and accelerations.
  State After(double h, const std::array<double, 3 * kBodies>& a) const {
    State out = *this;
    out.t += h;
    for (int k = 0; k < kBodies; ++k) {
      out.x[k] += h * vx[k] + 0.5 * h * h * a[3 * k];
      out.y[k] += h * vy[k] + 0.5 * h * h * a[3 * k + 1];
      out.theta[k] += h * omega[k] + 0.5 * h * h * a[3 * k + 2];
    }
    return out;
  }
};

class JointRowsTest : public ::testing::Test {
 protected:
  JointRowsTest() {
    const auto uniform = [&] { return random.Uniform(-1.0, 1.0); };
    for (auto* values : {&state.x, &state.y, &state.theta, &state.vx, &state.vy, &state.omega}) {
      for (double& v : *values) v = uniform();
    }
    state.t = 0.37;
    rows.pins.push_back({0, 1, uniform(), uniform(), uniform(), uniform(), "pin"});
    const double axis = uniform();
    // A target with a rate, so that its part in the rows is seen.
    const data::TimeFunction ramp = data::TimeFunction(0.8).Integral(0.3, 1.0);
    rows.alongs.push_back({1, 2, uniform(), uniform(), uniform(), uniform(), std::cos(axis),
                           std::sin(axis), -1.0, ramp, "slot"});
    rows.angles.push_back({2, 0, 0.4, -1.0, ramp, "held"});
    geometry.resize(rows.GeometrySize());
    jacobian.resize(6 * rows.rows());
  }

  std::vector<double> Positions(State at) {
    std::vector<double> phi(rows.rows());
    const Motion m = at.At();
    rows.FillGeometry(m, geometry.data(), nullptr);
    rows.Positions(m, geometry.data(), phi.data());
    return phi;
  }

  Rng random{20240611};
  State state;
  JointRows rows;
  std::vector<double> geometry, jacobian;
};

TEST_F(JointRowsTest, JacobianIsTheDerivativeOfThePositions) {
  rows.FillGeometry(state.At(), geometry.data(), jacobian.data());
  const std::vector<double> J = jacobian;
  for (int row = 0; row < rows.rows(); ++row) {
    for (int body = 0; body < kBodies; ++body) {
      for (int k = 0; k < 3; ++k) {
        State plus = state, minus = state;
        (k == 0 ? plus.x : k == 1 ? plus.y : plus.theta)[body] += kStep;
        (k == 0 ? minus.x : k == 1 ? minus.y : minus.theta)[body] -= kStep;
        const double expected = (Positions(plus)[row] - Positions(minus)[row]) / (2.0 * kStep);
        const double found = body == rows.Inner(row)   ? J[6 * row + k]
                             : body == rows.Outer(row) ? J[6 * row + 3 + k]
                                                       : 0.0;
        EXPECT_NEAR(found, expected, kFirst) << rows.NameOf(row) << " " << body << " " << k;
      }
    }
  }
}

TEST_F(JointRowsTest, VelocitiesAndResidualsAreTheDerivativesInTime) {
  std::array<double, 3 * kBodies> a;
  for (double& v : a) v = random.Uniform(-1.0, 1.0);
  const Motion m = state.At();
  rows.FillGeometry(m, geometry.data(), jacobian.data());
  std::vector<double> rate(rows.rows()), residual(rows.rows());
  rows.Velocities(m, geometry.data(), jacobian.data(), rate.data());
  std::array<double, kBodies> ax, ay, alpha;
  for (int k = 0; k < kBodies; ++k) ax[k] = a[3 * k], ay[k] = a[3 * k + 1], alpha[k] = a[3 * k + 2];
  rows.Residual(m, geometry.data(), jacobian.data(), ax.data(), ay.data(), alpha.data(),
                residual.data());
  const std::vector<double> now = Positions(state), later = Positions(state.After(kStep, a)),
                            before = Positions(state.After(-kStep, a));
  for (int row = 0; row < rows.rows(); ++row) {
    EXPECT_NEAR(rate[row], (later[row] - before[row]) / (2.0 * kStep), kFirst);
    // d2(Phi)/dt2 = J a - gamma, and the residual is gamma - J a.
    const double second = (later[row] - 2.0 * now[row] + before[row]) / (kStep * kStep);
    EXPECT_NEAR(residual[row], -second, kSecond) << rows.NameOf(row);
  }
}

TEST_F(JointRowsTest, LoadIsTheTransposedJacobian) {
  rows.FillGeometry(state.At(), geometry.data(), jacobian.data());
  std::vector<double> lambda(rows.rows());
  for (double& v : lambda) v = random.Uniform(-1.0, 1.0);
  std::array<double, kBodies> fx{}, fy{}, mm{};
  rows.AddLoad(geometry.data(), jacobian.data(), lambda.data(), fx.data(), fy.data(), mm.data());
  std::array<double, 3 * kBodies> expected{};
  for (int row = 0; row < rows.rows(); ++row) {
    for (int k = 0; k < 3; ++k) {
      expected[3 * rows.Inner(row) + k] += jacobian[6 * row + k] * lambda[row];
      expected[3 * rows.Outer(row) + k] += jacobian[6 * row + 3 + k] * lambda[row];
    }
  }
  for (int k = 0; k < kBodies; ++k) {
    EXPECT_NEAR(fx[k], expected[3 * k], 1e-14);
    EXPECT_NEAR(fy[k], expected[3 * k + 1], 1e-14);
    EXPECT_NEAR(mm[k], expected[3 * k + 2], 1e-14);
  }
}

}  // namespace
}  // namespace unfurl::sim::joint_rows_test
