#include "sim/implicit/equilibrium.h"

#include <algorithm>
#include <cmath>

#include "base/progress.h"
#include "sim/implicit/kkt.h"

namespace unfurl::sim {
namespace {

// Each turns by kLongestTurn at most, so that all together are some 60 turns.
constexpr int kEquilibriumMostIterations = 2000;
// Of pseudo-time, in time scales of the model: the first, within which nothing moves far; the
// longest, beside which masses do not count, so that it is Newton's.
constexpr double kEquilibriumFirstStep = 0.02, kLongestStep = 1e4;
constexpr double kLongestTurn = 0.2;  // of an angle in one iteration [rad], lengths alike
constexpr double kStill = 1e-13;      // of an iteration's step, of the length scale
// Of the pseudo-time step from one iteration to the next: one small residual does not make it
// Newton's at once.
constexpr double kEquilibriumMostGrowth = 4.0, kMostShrink = 0.25;

// Of what can move; angles as lengths [m/s^2].
double LargestAcceleration(const Model& model, const std::vector<double>& rate) {
  const int n = model.rigid_bodies.count;
  double largest = 0.0;
  for (int k = 0; k < n; ++k) {
    if (!model.rigid_bodies.IsDynamic(k)) continue;
    largest = std::max({largest, std::fabs(rate[3 * n + k]), std::fabs(rate[4 * n + k]),
                        model.length_scale * std::fabs(rate[5 * n + k])});
  }
  return largest;
}

// Of a step; lengths as angles [rad].
double LargestTurn(const Model& model, const std::vector<double>& x) {
  const int n = model.rigid_bodies.count;
  const double length = model.length_scale;
  double largest = 0.0;
  for (int k = 0; k < n; ++k) {
    largest = std::max(
        {largest, std::fabs(x[k]) / length, std::fabs(x[n + k]) / length, std::fabs(x[2 * n + k])});
  }
  return largest;
}

}  // namespace

EquilibriumReport FindEquilibrium(Dynamics* dynamics, double* y) {
  const Model& model = dynamics->model();
  const Constraints& constraints = model.constraints;
  const int n = model.rigid_bodies.count, rows = constraints.rows();
  std::fill_n(y + 3 * n, 3 * n, 0.0);
  std::vector<double> rate(model.index.size()), J(6 * rows + 6), drift(rows + 1), x(3 * n + kBlock);
  std::vector<double> lambda(rows + 1);
  Tangent tangent;
  EquilibriumReport report;
  const double first_step = kEquilibriumFirstStep * model.time_scale;
  double step = first_step, last = 0.0;
  for (report.iterations = 0; report.iterations < kEquilibriumMostIterations; ++report.iterations) {
    ThrowIfInterrupted();
    dynamics->RightSide(0.0, y, rate.data());
    const Constraints::Work& work = dynamics->constraint_work();
    std::copy_n(work.lambda.begin(), rows, lambda.begin());
    dynamics->FillTangent(0.0, y, lambda.data(), &tangent);
    constraints.Jacobian(dynamics->MotionAt(0.0, y), work, J.data());
    report.acceleration = LargestAcceleration(model, rate);
    if (!std::isfinite(report.acceleration)) return report;
    if (last > 0.0 && report.acceleration > 0.0) {
      step *= std::clamp(last / report.acceleration, kMostShrink, kEquilibriumMostGrowth);
      step = std::min(step, kLongestStep * model.time_scale);
    }
    last = report.acceleration;
    const double b = step * step;
    for (int k = 0; k < n; ++k) {
      x[k] = b * model.rigid_bodies.mass[k] * rate[3 * n + k];
      x[n + k] = b * model.rigid_bodies.mass[k] * rate[4 * n + k];
      x[2 * n + k] = b * model.rigid_bodies.inertia[k] * rate[5 * n + k];
    }
    if (rows > 0) {
      dynamics->PositionDrift(0.0, y);
      for (int r = 0; r < rows; ++r) drift[r] = -dynamics->constraint_work().lambda[r];
    }
    Saddle saddle(model.rigid_bodies, constraints, tangent);
    saddle.Factor(tangent, J.data(), 0.0, b);
    saddle.Solve(x.data(), drift.data());
    const double largest = LargestTurn(model, x);
    if (!std::isfinite(largest)) return report;
    const double part = largest > kLongestTurn ? kLongestTurn / largest : 1.0;
    if (part < 1.0) step = std::max(step * kMostShrink, first_step);
    for (int k = 0; k < 3 * n; ++k) y[k] += part * x[k];
    if (largest < kStill) {
      report.found = true;
      break;
    }
  }
  dynamics->RightSide(0.0, y, rate.data());
  return report;
}

EquilibriumReport FindLatchedEquilibrium(Dynamics* dynamics, double* y) {
  const Model& model = dynamics->model();
  for (LatchMode& mode : dynamics->modes()) mode = {1, 0, 1};
  const std::vector<double> start(y, y + model.index.size());
  EquilibriumReport report;
  for (int attempt = 0; attempt < 2; ++attempt) {
    report = FindEquilibrium(dynamics, y);
    if (!report.found) return report;
    // Where the load pulls a joint off the lower stop, it belongs to the upper one.
    bool moved = false;
    const Motion motion = dynamics->MotionAt(0.0, y);
    for (int k = 0; k < model.latches.count(); ++k) {
      LatchMode& mode = dynamics->modes()[k];
      const bool upper = mode.upper_contact != 0;
      const double theta = model.latches.hinge(k).Theta(motion);
      if (model.latches.At(k, upper, theta, 0.0).depth > 0.0) continue;
      mode = {1, static_cast<std::uint8_t>(!upper), static_cast<std::uint8_t>(upper)};
      moved = true;
    }
    if (!moved) break;
    report.found = false;
    std::copy(start.begin(), start.end(), y);
  }
  return report;
}

}  // namespace unfurl::sim
