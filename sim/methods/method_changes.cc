// Which stepper takes the steps.
#include <algorithm>

#include "sim/methods/integration.h"
#include "sim/methods/make_stepper.h"

namespace unfurl::sim {
namespace {

// Of the edge of stability, a step to begin with.
constexpr double kWithinEdge = 0.5;
// Tolerances of what moved that strains of the tolerance may hold where explicit steps are tried:
// these leave a small part of such strains. Of 2620 runs of beams held at one or both ends
// (tests/hard/held_beams_test.cc) 2 lost their balance with 1e3, 13 with 1e4; with 100 twice as
// many runs are above twice the best method's cost (AutoWork).
constexpr double kMostHeld = 1e3;

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
  if (switch_.AboutToTryExplicit() && SparesTrial(role, h)) return;
  pair_.TakeAtEdge();
  TakeOver(role, h);
}

// Whether the trial of an explicit method that is about to begin would be lost, or do harm.
bool Integration::SparesTrial(StepperSet::Role role, double* h) {
  const double rate = stepper_->ProbeFastestRate();
  const double within = kWithinEdge * steppers_.Get(role)->StabilityEdge();
  // Steps that never come near the edge leave nothing.
  const bool far = rate > 0.0 && rate * options_.max_step < within;
  if (!far && ForbidsExplicit() && switch_.Spare(0.0)) return true;
  if (!(rate > 0.0)) return false;
  if (switch_.Spare(steppers_.Get(role)->StableReach() / rate)) return true;
  // A step beyond the edge may look good, and leaves vibrations as large as the tolerance.
  *h = std::min(*h, within / rate);
  return false;
}

// Where nobody watches the energy, what the start tells of it has to do.
bool Integration::ForbidsExplicit() const {
  if (spares_explicit_ || held_ == 0.0) return spares_explicit_;
  const double energy = judge_.watches() ? judge_.moved() : EnergyScale(model_, scale_);
  return held_ > kMostHeld * scale_.rtol * energy;
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
  stepper_ = steppers_.Get(role);
  stepper_->Start(t_, start_);
  counted_work_ = static_cast<double>(steppers_.evaluations()) + report_.work;
  stable_ = true;
  doubted_ = false;
  use_ = 0.0;
}

}  // namespace unfurl::sim
