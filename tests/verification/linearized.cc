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
  for (int s = 0; s < model.rigid_bodies.count; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
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

}  // namespace unfurl::sim
