// Which stepper takes the steps.
#include <algorithm>

#include "sim/methods/integration.h"

namespace unfurl::sim {

void Integration::SwitchMethod(double gained, double* h) {
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
  if (switch_.AboutToTryExplicit()) {
    if (spares_explicit_ && switch_.Spare(0.0)) return;
    const double rate = stepper_->ProbeFastestRate();
    if (rate > 0.0 && switch_.Spare(steppers_.Get(role)->StableReach() / rate)) return;
  }
  pair_.TakeAtEdge();
  TakeOver(role, h);
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
