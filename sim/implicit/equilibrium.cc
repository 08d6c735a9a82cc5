#include "sim/implicit/equilibrium.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

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

namespace {

// Which stops the load presses. Where it pulls a joint off one it belongs to the other, and where
// it pulls it off both, to neither.
class Stops {
 public:
  explicit Stops(Dynamics* dynamics)
      : dynamics_(dynamics), pulled_off_(dynamics->modes().size(), {false, false}) {
    for (LatchMode& mode : dynamics->modes()) mode = {1, 0, 1};
  }

  // By where the joints are. False: each is where it is pressed to.
  bool Change(double* y) {
    const Latches& latches = dynamics_->model().latches;
    const Motion motion = dynamics_->MotionAt(0.0, y);
    bool changed = false;
    for (int k = 0; k < latches.count(); ++k) {
      LatchMode& mode = dynamics_->modes()[static_cast<std::size_t>(k)];
      const double theta = latches.hinge(k).Theta(motion);
      const bool above = latches.At(k, true, theta, 0.0).depth > 0.0;
      const bool below = latches.At(k, false, theta, 0.0).depth > 0.0;
      const LatchMode next = Next(mode, above, below, &pulled_off_[static_cast<std::size_t>(k)]);
      changed = changed || next.upper_contact != mode.upper_contact ||
                next.lower_contact != mode.lower_contact;
      mode = next;
    }
    return changed;
  }

 private:
  using Both = std::array<bool, 2>;  // upper, lower

  static LatchMode Next(const LatchMode& mode, bool above, bool below, Both* off) {
    if (mode.upper_contact != 0 && above) return mode;
    if (mode.lower_contact != 0 && below) return mode;
    if (mode.upper_contact != 0) (*off)[0] = true;
    if (mode.lower_contact != 0) (*off)[1] = true;
    const bool upper = above || (!below && !(*off)[0]), lower = !upper && (below || !(*off)[1]);
    return {1, static_cast<std::uint8_t>(upper), static_cast<std::uint8_t>(lower)};
  }

  Dynamics* dynamics_;
  std::vector<Both> pulled_off_;
};

constexpr int kMostChanges = 4;  // lower, upper, neither, and one that others bring about

EquilibriumReport SettleOnStops(Dynamics* dynamics, Stops stops, double* y) {
  const std::vector<double> start(y, y + dynamics->model().index.size());
  EquilibriumReport report;
  int iterations = 0;
  for (int change = 0; change < kMostChanges; ++change) {
    if (change > 0) std::copy(start.begin(), start.end(), y);
    report = FindEquilibrium(dynamics, y);
    report.iterations = iterations += report.iterations;
    if (!report.found || !stops.Change(y)) return report;
  }
  report.found = false;
  return report;
}

// The depth at which a contact at rest bears `force` [m]; its law rises. NaN: at none.
double DepthOf(const ContactLaw& law, double force, double about) {
  const auto bears = [&](double depth) { return law.At(depth, 0.0).elastic >= force; };
  double low = about, high = about;
  while (bears(low) && low > 0.0) low *= 0.5;
  while (!bears(high)) {
    high *= 2.0;
    if (!std::isfinite(high)) return std::numeric_limits<double>::quiet_NaN();
  }
  for (int i = 0; i < 60 && low < high; ++i) {
    (bears(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
  }
  return high;
}

// A contact's law has no stiffness where it begins, nor beyond: what bounces off it in the search
// flies away. So each stop is held by a spring first, of the contact's stiffness at the depth of
// the clearance, which tells the load and the side that it presses; then by one that bears this
// load at the depth at which the contact does.
EquilibriumReport HoldOnStops(Dynamics* dynamics, Stops* stops, double* y) {
  const Latches& latches = dynamics->model().latches;
  const int count = latches.count();
  std::vector<double> stiffness(static_cast<std::size_t>(count)), reach(stiffness);
  for (int k = 0; k < count; ++k) {
    constexpr double kNoClearance = 1e-3;  // [rad]: any angle that is small
    const double clearance = latches.StopOf(k, true).level - latches.StopOf(k, false).level;
    reach[k] = latches.Depth(k, clearance > 0.0 ? clearance : kNoClearance);
    stiffness[k] = latches.law(k).At(reach[k], 0.0).by_depth;
  }
  dynamics->HoldLatches(stiffness.data());
  EquilibriumReport report;
  int iterations = 0;
  bool borne = false;  // the stiffnesses are those of the loads
  for (int change = 0; change <= kMostChanges; ++change) {
    report = FindEquilibrium(dynamics, y);
    report.iterations = iterations += report.iterations;
    if (!report.found) break;
    const bool changed = stops->Change(y);
    if (!changed && borne) break;
    const Motion motion = dynamics->MotionAt(0.0, y);
    for (int k = 0; k < count && !changed; ++k) {
      const bool upper = dynamics->modes()[static_cast<std::size_t>(k)].upper_contact != 0;
      const double theta = latches.hinge(k).Theta(motion);
      const double force = latches.Held(k, upper, theta, stiffness[k]).force;
      const double depth = force > 0.0 ? DepthOf(latches.law(k), force, reach[k]) : 0.0;
      if (depth > 0.0) stiffness[k] = force / depth;
    }
    borne = !changed;
  }
  dynamics->HoldLatches(nullptr);
  return report;
}

}  // namespace

EquilibriumReport FindLatchedEquilibrium(Dynamics* dynamics, double* y) {
  const std::vector<double> start(y, y + dynamics->model().index.size());
  Stops stops(dynamics);
  const EquilibriumReport held = HoldOnStops(dynamics, &stops, y);
  if (held.found) {
    EquilibriumReport report = SettleOnStops(dynamics, stops, y);
    report.iterations += held.iterations;
    if (report.found) return report;
  }
  std::copy(start.begin(), start.end(), y);
  return SettleOnStops(dynamics, Stops(dynamics), y);
}

}  // namespace unfurl::sim
