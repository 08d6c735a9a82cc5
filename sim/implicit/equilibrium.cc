#include "sim/implicit/equilibrium.h"

#include <algorithm>
#include <cmath>

#include "base/progress.h"
#include "sim/implicit/linearised.h"

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
// What falls far moves ahead with a residual that hardly changes. The step then doubles as long as
// the residual grows by less than a tenth, and stiffness, where it is negative, makes the move no
// more than half as much again: a step later it is three times as much, and never turned about,
// which would lead to where a pendulum stands on its head.
constexpr double kStays = 0.9, kTame = 1.5, kDoubling = 2.0, kWild = 3.0;

// Of vectors of three blocks, of what can move; angles as lengths, of the length scale.
double LargestOf(const Model& model, const Linearised& system, const double* v) {
  const int n = model.rigid_bodies.count;
  double largest = 0.0;
  for (const int k : system.entries()) {
    const double size = std::fabs(v[k]) / (k < 2 * n ? model.length_scale : 1.0);
    if (!(size <= largest)) largest = size;  // and what is not a number
  }
  return largest;
}

// Of the pseudo-time step. `fall`: of the acceleration in the last iteration; `pulled`: its move
// over that without stiffness, 0 where that is not to count.
double ChangeOfStep(double fall, double pulled) {
  const double change = std::clamp(fall, kMostShrink, kEquilibriumMostGrowth);
  if (pulled > kWild) return std::min(change, 1.0 / kDoubling);
  const bool tame = pulled > 0.0 && pulled < kTame && change > kStays;
  return tame ? std::max(change, kDoubling) : change;
}

// `hurried`: what falls far gets there; but stiff beams that nearly stand may be thrown about.
EquilibriumReport Search(Dynamics* dynamics, bool hurried, double* y) {
  const Model& model = dynamics->model();
  const int n = model.rigid_bodies.count, rows = model.constraints.rows();
  std::fill_n(y + 3 * n, 3 * n, 0.0);
  Linearised system(dynamics);
  std::vector<double> drift(rows + 1), x(system.length());
  EquilibriumReport report;
  const double first_step = kEquilibriumFirstStep * model.time_scale;
  double step = first_step, last = 0.0;
  double pulled = 0.0;  // the last move over that without stiffness; 0: it was cut [-]
  for (report.iterations = 0; report.iterations < kEquilibriumMostIterations; ++report.iterations) {
    ThrowIfInterrupted();
    system.About(y);
    const double* acceleration = system.rate().data() + 3 * n;
    report.acceleration = model.length_scale * LargestOf(model, system, acceleration);
    if (!std::isfinite(report.acceleration)) return report;
    if (last > 0.0 && report.acceleration > 0.0) {
      step *= ChangeOfStep(last / report.acceleration, hurried ? pulled : 0.0);
      step = std::min(step, kLongestStep * model.time_scale);
    }
    last = report.acceleration;
    const double b = step * step;
    for (int k = 0; k < 3 * n; ++k) x[k] = b * acceleration[k];
    const double freely = LargestOf(model, system, x.data());
    system.MassTimes(x.data());
    if (rows > 0) {
      dynamics->PositionDrift(0.0, y);
      for (int r = 0; r < rows; ++r) drift[r] = -dynamics->constraint_work().drift[r];
    }
    system.Factor(b);
    system.Solve(x.data(), drift.data());
    const double largest = LargestOf(model, system, x.data());  // lengths as angles [rad]
    if (!std::isfinite(largest)) return report;
    const double part = largest > kLongestTurn ? kLongestTurn / largest : 1.0;
    pulled = part == 1.0 && freely > 0.0 ? largest / freely : 0.0;
    if (part < 1.0) step = std::max(step * kMostShrink, first_step);
    for (const int k : system.entries()) y[k] += part * x[k];
    if (largest < kStill) {
      report.found = true;
      break;
    }
  }
  return report;
}

}  // namespace

EquilibriumReport FindEquilibrium(Dynamics* dynamics, double* y) {
  const std::size_t size = dynamics->model().index.size();
  const std::vector<double> start(y, y + size);
  EquilibriumReport report = Search(dynamics, false, y);
  if (!report.found) {
    std::vector<double> other = start;
    const EquilibriumReport hurried = Search(dynamics, true, other.data());
    if (hurried.found) {
      std::copy(other.begin(), other.end(), y);
      report = hurried;
    }
  }
  std::vector<double> rate(size);
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
