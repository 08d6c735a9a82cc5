#include "sim/effects/bending.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"
#include "sim/dynamics/trigonometry.h"

namespace unfurl::sim::bending_test {
namespace {

// Eight bodies in a bent row, joined by elements.
class BendingTest : public ::testing::Test {
 protected:
  static constexpr int kBodies = 16, kBeam = 8;

  void SetUp() override {
    Rng rng(21);
    for (auto* a : {&x, &y, &theta, &vx, &vy, &omega, &c, &s, &fx, &fy, &m})
      a->assign(kBodies, 0.0);
    for (int k = 0; k < kBeam; ++k) {
      x[k] = 0.1 * k + 0.003 * rng.Normal();
      y[k] = 0.003 * rng.Normal();
      theta[k] = 0.1 * k + 0.05 * rng.Normal();
      vx[k] = rng.Normal(), vy[k] = rng.Normal(), omega[k] = rng.Normal();
    }
  }

  Bending Make(double EA, double beta, bool gradient) const {
    Bending bending(kBeam);
    for (int e = 0; e < kBeam - 1; ++e) bending.Set(e, {0.1, 18.7 + e, EA, beta, gradient});
    return bending;
  }

  Motion Now() {
    SinCos(theta.data(), kBodies, s.data(), c.data());
    return {0.0,       x.data(),     y.data(), theta.data(), vx.data(),
            vy.data(), omega.data(), c.data(), s.data()};
  }

  double Load(const Bending& bending) {
    std::fill(fx.begin(), fx.end(), 0.0);
    std::fill(fy.begin(), fy.end(), 0.0);
    std::fill(m.begin(), m.end(), 0.0);
    std::vector<double> scratch(bending.ScratchSize(), 0.0);
    double power = 0.0;
    bending.AddLoad(Now(), scratch.data(), {fx.data(), fy.data(), m.data()}, &power);
    return power;
  }

  Array x, y, theta, vx, vy, omega, c, s, fx, fy, m;
};

TEST_F(BendingTest, ForcesAreTheGradientOfTheEnergy) {
  // Central differences with h = 1e-5 of an energy of some 1e3 J: 1e-10 h^2-terms, 1e-8 rounding.
  constexpr double kTolerance = 2e-6, kStep = 1e-5;
  const Bending bending = Make(1e4, 0.0, true);
  Load(bending);
  const auto energy = [&] { return bending.Energy(Now()) + bending.AxialEnergy(Now()); };
  for (int k = 0; k < kBeam; ++k) {
    for (auto [coordinate, force] : {std::pair{&x, &fx}, {&y, &fy}, {&theta, &m}}) {
      double& q = (*coordinate)[k];
      const double at = q;
      q = at + kStep;
      const double up = energy();
      q = at - kStep;
      const double down = energy();
      q = at;
      const double expected = -(up - down) / (2 * kStep);
      EXPECT_NEAR((*force)[k], expected, kTolerance * (1.0 + std::fabs(expected)));
    }
  }
}

TEST_F(BendingTest, GradientFormKeepsBothMomenta) {
  constexpr double kRounding = 1e-10;  // of moments of some 1e3 N m
  for (const double EA : {0.0, 1e4}) {
    for (const double beta : {0.0, 1e-3}) {
      Load(Make(EA, beta, true));
      double px = 0.0, py = 0.0, L = 0.0;
      for (int k = 0; k < kBeam; ++k) {
        px += fx[k], py += fy[k];
        L += x[k] * fy[k] - y[k] * fx[k] + m[k];
      }
      EXPECT_NEAR(px, 0.0, kRounding);
      EXPECT_NEAR(py, 0.0, kRounding);
      EXPECT_NEAR(L, 0.0, kRounding);
    }
  }
}

// As printed, the two stations lack -(F_y (dx - l) - F_x dy) / 2 each; the forces are the same.
TEST_F(BendingTest, PrintedFormLacksTheStatedMoment) {
  constexpr double kRounding = 1e-10;
  const Bending gradient = Make(1e4, 0.0, true), printed = Make(1e4, 0.0, false);
  Load(gradient);
  const Array gx = fx, gm = m;
  Load(printed);
  std::vector<double> lacking(kBeam, 0.0);
  for (int e = 0; e < kBeam - 1; ++e) {
    const double mean = 0.5 * (theta[e] + theta[e + 1]), l = 0.1;
    const double rx = x[e + 1] - x[e], ry = y[e + 1] - y[e];
    const double dx = std::cos(mean) * rx + std::sin(mean) * ry;
    const double dy = std::cos(mean) * ry - std::sin(mean) * rx;
    // F is the force that deforms the element at j, P of eq. (8); a body feels its opposite.
    const double Fx = 1e4 / l * (dx - l), Fy = 12.0 * (18.7 + e) / (l * l * l) * dy;
    for (int k : {e, e + 1}) lacking[k] -= -(Fy * (dx - l) - Fx * dy) / 2.0;
  }
  for (int k = 0; k < kBeam; ++k) {
    EXPECT_NEAR(fx[k], gx[k], kRounding);
    EXPECT_NEAR(gm[k] - m[k], lacking[k], kRounding);
  }
}

// The power of the damping forces is what they take from the motion.
TEST_F(BendingTest, DissipatedPowerIsTheWorkOfTheDampingForces) {
  for (const double EA : {0.0, 1e4}) {
    const double none = Load(Make(EA, 0.0, true));
    const Array ex = fx, ey = fy, em = m;
    const double power = Load(Make(EA, 2e-3, true));
    double work = 0.0;
    for (int k = 0; k < kBeam; ++k) {
      work -= (fx[k] - ex[k]) * vx[k] + (fy[k] - ey[k]) * vy[k] + (m[k] - em[k]) * omega[k];
    }
    EXPECT_EQ(none, 0.0);
    EXPECT_GT(power, 0.0);
    EXPECT_NEAR(power, work, 1e-12 * power);
  }
}

// A cubic bent between its ends stores EI / 2 times the integral of the curvature squared.
TEST_F(BendingTest, EnergyOfAGivenBend) {
  Bending bending(kBeam);
  bending.Set(0, {0.1, 20.0, 0.0, 0.0, true});
  std::fill(theta.begin(), theta.end(), 0.0);
  std::fill(y.begin(), y.end(), 0.0);
  std::fill(x.begin(), x.end(), 0.0);
  x[1] = 0.1;
  theta[0] = -0.01;
  theta[1] = 0.01;  // constant curvature 0.2 per metre
  EXPECT_NEAR(bending.Energy(Now()), 0.5 * 20.0 * 0.2 * 0.2 * 0.1, 1e-15);
}

}  // namespace
}  // namespace unfurl::sim::bending_test
