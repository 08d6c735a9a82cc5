#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "scenes.h"
#include "sim/dynamics.h"

namespace unfurl::sim {
namespace {

// Natural frequencies [rad/s], lowest first, of the transverse motion about a straight beam at rest
// along x: accelerations of y and theta of the segments are linear in them there (the longitudinal
// constraints do not enter to first order), so differences of the right side give the dynamic
// matrix. Rigid motions (zero) are left out.
constexpr double kRigid = 1.0;  // [1/s^2]; the lowest elastic mode here has 123
std::vector<double> Frequencies(const Model& model) {
  Dynamics dynamics(model);
  const StateIndex& i = model.index;
  std::vector<int> q, a;
  for (int s = 0; s < model.slots.count; ++s) {
    if (!model.slots.IsDynamic(s)) continue;
    q.push_back(i.y(s)), a.push_back(i.vy(s));
    q.push_back(i.theta(s)), a.push_back(i.omega(s));
  }
  const Eigen::Index n = static_cast<Eigen::Index>(q.size());
  Eigen::MatrixXd A(n, n);
  // Low modes are small beside the entries, but at rest everything is exactly zero and rounding
  // relative: small steps, of a millionth of a segment or a radian, keep the nonlinear terms away.
  const double length = model.beams[0].segment_length;
  for (Eigen::Index c = 0; c < n; ++c) {
    const double h = 1e-6 * (c % 2 == 0 ? length : 1.0);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(n);
    for (const auto& [at, weight] : {std::pair{1.0, 8.0}, {-1.0, -8.0}, {2.0, -1.0}, {-2.0, 1.0}}) {
      std::vector<double> y = model.initial_state, rate(y.size());
      y[q[c]] += at * h;
      dynamics.RightSide(0.0, y.data(), rate.data());
      for (Eigen::Index r = 0; r < n; ++r) sum[r] += weight * rate[a[r]];
    }
    A.col(c) = sum / (12.0 * h);
  }
  // With the square roots of the masses it is symmetric.
  Eigen::VectorXd root(n);
  for (Eigen::Index r = 0; r < n; ++r) {
    const int slot = (r % 2 == 0 ? q[r] - i.y(0) : q[r] - i.theta(0));
    root[r] = std::sqrt(r % 2 == 0 ? model.slots.mass[slot] : model.slots.inertia[slot]);
  }
  const Eigen::MatrixXd B = root.asDiagonal() * A * root.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(-0.5 * (B + B.transpose()));
  std::vector<double> frequencies;
  for (const double value : solver.eigenvalues()) {
    if (value > kRigid) frequencies.push_back(std::sqrt(value));
  }
  return frequencies;
}

// Roots of the beams' characteristic equations (Euler-Bernoulli): beta L.
constexpr double kCantilever[3] = {1.87510406871196, 4.69409113297418, 7.85475743823761};
constexpr double kFreeFree[3] = {4.73004074486270, 7.85320462409584, 10.9956078380017};

// The order of convergence between n and 2 n must be 2, from both sides.
void ExpectSecondOrder(const std::string& ends, const double* roots) {
  constexpr double kLow = 1.93, kHigh = 2.07;  // higher terms: a few (l k)^2, below 0.05
  const double scale = std::sqrt(10.0);        // sqrt(EI / (rho A)) of a 1 m, 1 kg beam
  std::vector<std::vector<double>> at;
  for (const int segments : {12, 24, 48})
    at.push_back(Frequencies(ModelFrom(BeamScene(ends, segments))));
  for (int mode = 0; mode < 3; ++mode) {
    const double exact = roots[mode] * roots[mode] * scale;
    double error[3];
    for (int k = 0; k < 3; ++k) error[k] = at[k][mode] / exact - 1.0;
    for (int k = 0; k < 2; ++k) {
      const double order = std::log2(error[k] / error[k + 1]);
      EXPECT_GT(order, kLow) << ends << " mode " << mode;
      EXPECT_LT(order, kHigh) << ends << " mode " << mode;
    }
    EXPECT_LT(std::fabs(error[2]), 2e-3);
  }
}

TEST(BeamFrequencies, CantileverIsOfSecondOrder) { ExpectSecondOrder("clamped", kCantilever); }
TEST(BeamFrequencies, FreeFreeIsOfSecondOrder) { ExpectSecondOrder("free", kFreeFree); }

// What remains of the error is the interior lumping: (l^2 / 24) int(v v'') / int(v^2), relative.
TEST(BeamFrequencies, RemainingErrorIsTheInteriorLumping) {
  const double k = kFreeFree[0], l = 1.0 / 48;
  const double sigma = (std::cosh(k) - std::cos(k)) / (std::sinh(k) - std::sin(k));
  double vv = 0.0, vc = 0.0;
  constexpr int kPoints = 4000;
  for (int i = 0; i < kPoints; ++i) {
    const double x = k * (i + 0.5) / kPoints;
    const double v = std::cosh(x) + std::cos(x) - sigma * (std::sinh(x) + std::sin(x));
    const double c = k * k * (std::cosh(x) - std::cos(x) - sigma * (std::sinh(x) - std::sin(x)));
    vv += v * v;
    vc += v * c;
  }
  const double expected = l * l / 24.0 * vc / vv;
  const double found =
      Frequencies(ModelFrom(BeamScene("free", 48)))[0] / (k * k * std::sqrt(10.0)) - 1.0;
  EXPECT_NEAR(found, expected, 0.02 * std::fabs(expected));
}

}  // namespace
}  // namespace unfurl::sim
