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

constexpr int kEquilibriumMostIterations = 2000;  // steps, of which a far start takes some 100
// Of pseudo-time, in time scales of the model: the first, within which nothing moves far; the
// longest, beside which masses do not count, so that it is Newton's.
constexpr double kEquilibriumFirstStep = 0.02, kLongestStep = 1e4;
constexpr double kLongestTurn = 0.3;  // of an angle in one step [rad], lengths alike
constexpr double kStillStep = 1e-13;  // of a step's move, of the length scale
// A step is solved by Newton's iterations. Turns upset what is stiff by their square, and these put
// that right; a step whose moves do not fall by half each time is too long.
constexpr int kMostCorrections = 6;
constexpr double kContracts = 0.5, kSolved = 0.02;  // of the move before; of the first move [-]
// Moves, of the length scale: of which rounding is a part; whose squares are too small to keep them
// from falling by half, so that rounding does.
constexpr double kNeedsNone = 1e-11, kRounding = 1e-9;
// Of the step, of pseudo-time: after one that was easily solved, solved, and not.
constexpr double kEasy = 0.1;  // of the move before, the largest of the corrections [-]
constexpr double kLeap = 4.0, kGrowth = 2.0, kShrink = 0.4, kAfterShrink = 1.3;  // factors [-]
constexpr double kRoom = 0.7;  // of the longest turn, which the next step is meant for
// Where stiffness is negative along the move it is more than without stiffness. Half as much again
// is taken and no longer step tried; three times as much, and what turned about, is not taken: it
// would lead to where a pendulum stands on its head.
constexpr double kTame = 1.5, kWild = 3.0;

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

// Implicit Euler steps of the flow dq / db = a, where b is the square of a pseudo-time.
class Search {
 public:
  explicit Search(Dynamics* dynamics)
      : dynamics_(*dynamics),
        model_(dynamics->model()),
        n_(model_.rigid_bodies.count),
        system_(dynamics, false),
        drift_(static_cast<std::size_t>(model_.constraints.rows()) + 1),
        from_(model_.index.size()),
        x_(system_.length()),
        pull_(system_.length()) {}

  EquilibriumReport Run(double* y) {
    std::fill_n(y + 3 * n_, 3 * n_, 0.0);
    EquilibriumReport report;
    const double first = kEquilibriumFirstStep * model_.time_scale;
    const double longest = kLongestStep * model_.time_scale;
    double step = first;
    bool shortened = false;
    for (; report.iterations < kEquilibriumMostIterations; ++report.iterations) {
      ThrowIfInterrupted();
      system_.About(y);
      const double* acceleration = system_.rate().data() + 3 * n_;
      report.acceleration = model_.length_scale * LargestOf(model_, system_, acceleration);
      if (!std::isfinite(report.acceleration)) return report;
      std::copy_n(y, model_.index.size(), from_.begin());
      const double change = Step(step * step, acceleration, y);
      if ((moved_ < kStillStep && change > 0.0) || rounded_) {
        report.found = true;
        break;
      }
      const bool careful = shortened;
      shortened = !(change > 0.0);
      if (shortened) std::copy(from_.begin(), from_.end(), y);
      step *= shortened ? kShrink : careful ? std::min(change, kAfterShrink) : change;
      step = std::min(step, longest);
      if (step < kEquilibriumFirstStep * kEquilibriumFirstStep * first) break;
    }
    return report;
  }

 private:
  // Of the next step over this one; 0: it is to be taken again, shorter.
  double Step(double b, const double* acceleration, double* y) {
    for (int k = 0; k < 3 * n_; ++k) x_[k] = b * acceleration[k];
    system_.MassTimes(x_.data());
    pull_ = x_;
    Drift(y);
    system_.Factor(b);
    system_.Solve(x_.data(), drift_.data());
    double last = moved_ = LargestOf(model_, system_, x_.data());
    if (!std::isfinite(last) || last > kLongestTurn) return 0.0;
    if (last < kStillStep) return 1.0;
    const double turned = Turned();
    if (!(turned > 0.0) || turned > kWild) return 0.0;
    Add(y);
    double worst = 0.0;
    const double solved = std::max(kSolved * moved_, kNeedsNone);
    for (int k = 0; k < kMostCorrections && last > solved; ++k) {
      Correct(b, y);
      const double next = LargestOf(model_, system_, x_.data());
      worst = std::max(worst, next / last);
      if (!(next < kContracts * last)) {
        rounded_ = moved_ < kRounding;
        return 0.0;
      }
      Add(y);
      last = next;
    }
    if (turned > kTame) return 1.0;
    const double room = kRoom * kLongestTurn / moved_;
    return std::min(worst < kEasy ? kLeap : kGrowth, std::max(1.0, std::sqrt(room)));
  }

  // What is left of the step's equation at y, into x_.
  void Correct(double b, const double* y) {
    state_.assign(y, y + model_.index.size());
    system_.About(state_.data());
    gone_.assign(system_.length(), 0.0);
    for (const int k : system_.entries()) gone_[k] = y[k] - from_[k];
    system_.Fill(gone_.data());
    const double* acceleration = system_.rate().data() + 3 * n_;
    for (int k = 0; k < 3 * n_; ++k) x_[k] = b * acceleration[k] - gone_[k];
    system_.MassTimes(x_.data());
    Drift(state_.data());
    system_.Factor(b);
    system_.Solve(x_.data(), drift_.data());
  }

  void Drift(double* y) {
    if (model_.constraints.rows() == 0) return;
    dynamics_.PositionDrift(0.0, y);
    for (std::size_t r = 0; r + 1 < drift_.size(); ++r) {
      drift_[r] = -dynamics_.constraint_work().drift[r];
    }
  }

  void Add(double* y) {
    for (const int k : system_.entries()) y[k] += x_[k];
  }

  // The move over what it were without stiffness along it, in the masses' measure [-].
  double Turned() {
    std::vector<double> momentum = x_;
    system_.MassTimes(momentum.data());
    double own = 0.0, pulled = 0.0;
    for (const int k : system_.entries()) {
      own += x_[k] * momentum[k];
      pulled += x_[k] * pull_[k];
    }
    return own / pulled;
  }

  Dynamics& dynamics_;
  const Model& model_;
  int n_;
  Linearised system_;
  double moved_ = 0.0;  // of the last step, its first move
  bool rounded_ = false;
  std::vector<double> drift_, from_, state_, gone_, x_, pull_;
};

}  // namespace

EquilibriumReport FindEquilibrium(Dynamics* dynamics, double* y) {
  const std::size_t size = dynamics->model().index.size();
  const EquilibriumReport report = Search(dynamics).Run(y);
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
