#include "linearized.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

namespace unfurl::sim {

std::vector<double> TransverseFrequencies(const Model& model, double rigid) {
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
  // At rest everything is exactly zero and rounding relative: small steps, of a millionth of a
  // segment or a radian, keep the nonlinear terms away.
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
  // A = -P M^-1 K with the M-orthogonal projector P onto what pins allow: real eigenvalues, though
  // A is not symmetric.
  const Eigen::EigenSolver<Eigen::MatrixXd> solver(A, false);
  std::vector<double> frequencies;
  for (const auto& value : solver.eigenvalues()) {
    if (-value.real() > rigid) frequencies.push_back(std::sqrt(-value.real()));
  }
  std::sort(frequencies.begin(), frequencies.end());
  return frequencies;
}

double FindEquilibrium(const Model& model, std::vector<double>* state) {
  Dynamics dynamics(model);
  const StateIndex& index = model.index;
  std::vector<int> q, a;
  for (int s = 0; s < model.slots.count; ++s) {
    if (!model.slots.IsDynamic(s)) continue;
    q.insert(q.end(), {index.x(s), index.y(s), index.theta(s)});
    a.insert(a.end(), {index.vx(s), index.vy(s), index.omega(s)});
  }
  const Eigen::Index n = static_cast<Eigen::Index>(q.size());
  std::vector<double> rate(state->size());
  const auto accelerations = [&](std::vector<double> y) {
    dynamics.RightSide(0.0, y.data(), rate.data());
    Eigen::VectorXd out(n);
    for (Eigen::Index k = 0; k < n; ++k) out[k] = rate[a[k]];
    return out;
  };
  constexpr double kStep = 1e-6;
  constexpr int kRounds = 40;
  double left = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::VectorXd at = accelerations(*state);
    left = at.cwiseAbs().maxCoeff();
    Eigen::MatrixXd A(n, n);
    for (Eigen::Index c = 0; c < n; ++c) {
      std::vector<double> more = *state, less = *state;
      more[q[c]] += kStep, less[q[c]] -= kStep;
      A.col(c) = (accelerations(more) - accelerations(less)) / (2.0 * kStep);
    }
    // Directions that constraints forbid give no acceleration worth the name: least norm.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
    solver.setThreshold(1e-9);
    Eigen::VectorXd step = solver.compute(A).solve(-at);
    step *= std::min(1.0, 0.3 / step.cwiseAbs().maxCoeff());  // [m], [rad]
    for (Eigen::Index k = 0; k < n; ++k) (*state)[q[k]] += step[k];
    for (int k = 0; k < 4; ++k) {
      dynamics.RightSide(0.0, state->data(), rate.data());
      dynamics.Project(0.0, state->data());
    }
    for (const int entry : a) (*state)[entry] = 0.0;
    if (step.cwiseAbs().maxCoeff() < 1e-11) break;
  }
  return left;
}

}  // namespace unfurl::sim
