// Which stepper takes the steps.
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/methods/integration.h"
#include "sim/methods/make_stepper.h"

namespace unfurl::sim {
namespace {

// Of the edge of stability, a step to begin with.
constexpr double kWithinEdge = 0.5;
// Tolerances of what moved that strains of explicit steps' tolerance may hold: steps leave a small
// part of such strains. Of 2620 runs of beams held at one or both ends
// (tests/hard/held_beams_test.cc) 2 lost their balance with 1e3, 13 with 1e4.
constexpr double kMostHeld = 1e3;
// Explicit steps are not held to less: some hundred roundings of a state [-].
constexpr double kTightestExplicit = 1e-13;
// Steps that the edge has shortened before it is looked for again: what that costs, 21 right sides,
// is 3% of them.
constexpr int kLookAgain = 64;

}  // namespace

void Integration::SwitchMethod(double gained, double* h) {
  // What explicit steps leave in stretching at each step adds up; implicit ones damp it out.
  if (!spares_explicit_ && !switch_.implicit() && judge_.AxisLosesBalance()) {
    spares_explicit_ = true;
    switch_.Spare(0.0);
    TakeOver(StepperSet::kImplicit, h);
    return;
  }
  const double work = static_cast<double>(steppers_.evaluations()) + report_.work;
  const double cost = work - counted_work_;
  counted_work_ = work;
  const bool pairs = steppers_.HasEdgePair() && role_ != StepperSet::kImplicit;
  if (pairs && pair_.Note(use_ * stepper_->StabilityEdge(), cost)) {
    switch_.Restart();
    TakeOver(pair_.at_edge() ? StepperSet::kAtEdge : StepperSet::kPair, h);
    return;
  }
  // Before an implicit method is tried, the pair that is stable farther is.
  const bool unstable = doubted_ && !(pairs && !pair_.at_edge());
  if (!switch_.Note(gained, cost, unstable)) return;
  if (switch_.implicit()) {
    TakeOver(StepperSet::kImplicit, h);
    return;
  }
  const StepperSet::Role role = steppers_.HasEdgePair() ? StepperSet::kAtEdge : StepperSet::kPair;
  if (SparesExplicit(role, h)) return;
  pair_.TakeAtEdge();
  TakeOver(role, h);
}

// Whether a trial of the explicit method that is about to begin would be lost, or do harm; else
// makes it ready.
bool Integration::SparesExplicit(StepperSet::Role role, double* h) {
  const bool trial = switch_.AboutToTryExplicit(), segments = held_ > 0.0 && !stretches_;
  if (!trial && !segments) return false;  // it was seen to be faster
  const double rate = stepper_->ProbeFastestRate();
  const double within = kWithinEdge * steppers_.Get(role)->StabilityEdge();
  // Steps that never come near the edge leave nothing.
  const bool far = rate > 0.0 && rate * options_.max_step < within;
  const double rtol = far ? scale_.rtol : ExplicitTolerance();
  if (trial && !(rtol >= kTightestExplicit) && switch_.Spare(0.0)) return true;
  if (!(rate > 0.0)) return false;
  if (trial && switch_.Spare(steppers_.Get(role)->StableReach() / rate)) return true;
  steppers_.SetExplicitTolerance(std::max(rtol, kTightestExplicit));
  if (segments) edge_rate_ = rate;
  // A step beyond the edge may look good, and leaves vibrations as large as the tolerance.
  *h = std::min(*h, within / rate);
  return false;
}

// Beyond it an explicit step is not stable; infinite where nothing keeps steps within it. Near
// states where constraints depend on one another another method takes them.
double Integration::StepAtEdge() const {
  if (edge_rate_ == 0.0 || is_near_) return std::numeric_limits<double>::infinity();
  return stepper_->StabilityEdge() / edge_rate_;
}

// Where beams stretch no explicit step goes beyond the edge of its stability: the two estimates of
// the pair of order eight may cancel there (seen: 0.1 of what is allowed, from 6e3 of the one), and
// a step after a small error by chance is up to five times as long as the one before.
void Integration::KeepWithinEdge(double* h) {
  const double edge = StepAtEdge();
  if (*h <= edge) return;
  *h = edge;
  limit_ = StepLimit::kStability;
  if (++kept_within_ % kLookAgain != 0) return;
  // A contact that made the rate may be open by now.
  Stepper* const probe = steppers_.Get(StepperSet::kImplicit);
  std::copy_n(stepper_->state(), sample_.size(), start_.begin());
  probe->Start(t_, start_);
  edge_rate_ = probe->ProbeFastestRate();
}

// At which strains hold no more than they may; at the edge of stability a tighter one shortens no
// step. Smooth beams have fast motions of many rates, which what is left then sets going for good:
// they take none. Where nobody watches the energy, what the start tells of it has to do. 0: none.
double Integration::ExplicitTolerance() const {
  if (spares_explicit_ || held_ == 0.0) return spares_explicit_ ? 0.0 : scale_.rtol;
  const double energy = judge_.watches() ? judge_.moved() : EnergyScale(model_, scale_);
  const double allowed = kMostHeld * scale_.rtol * energy / held_;  // strains squared
  if (stretches_) return allowed < 1.0 ? 0.0 : scale_.rtol;
  return scale_.rtol * std::sqrt(std::clamp(allowed, 0.0, 1.0));
}

// An explicit step leaves vibrations as large as the tolerance: short implicit steps would resolve
// them, long ones damp them out at once. So implicit steps begin with the longest there is, which
// comes down fivefold a trial to what the motion allows.
void Integration::TakeOver(StepperSet::Role role, double* h) {
  std::copy_n(stepper_->state(), sample_.size(), start_.begin());
  last_step_[role_] = *h;
  if (role == StepperSet::kImplicit) {
    *h = options_.max_step;
  } else if (last_step_[role] > 0.0) {
    *h = std::min(*h, last_step_[role]);
  }
  role_ = role;
  if (role == StepperSet::kImplicit) edge_rate_ = 0.0;
  stepper_ = steppers_.Get(role);
  stepper_->Start(t_, start_);
  counted_work_ = static_cast<double>(steppers_.evaluations()) + report_.work;
  stable_ = true;
  doubted_ = false;
  use_ = 0.0;
}

}  // namespace unfurl::sim
