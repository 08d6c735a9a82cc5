// How long the next step is, and how near-dependent constraints are passed.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/dynamics/observables.h"
#include "sim/methods/integration.h"

namespace unfurl::sim {
namespace {

// Controller of Hairer, Norsett and Wanner (Solving ODEs I, II.4), with memory against the
// oscillation of steps that stability limits.
constexpr double kSafety = 0.9, kMemory = 0.2;              // memory times the order
constexpr double kMostGrowth = 5.0, kMostStepShrink = 0.2;  // of one step by the one before
// Of the options' time scale: how far ahead a function of time is looked for that fails; the
// smallest step, also of the time reached.
constexpr double kFunctionsAhead = 1e-9, kSmallestStep = 1e-15;
// Where the smallest pivot has fallen to this part of the largest that it has been, constraints are
// near to depending on one another (it goes with the square of the distance), and the drift of an
// explicit step in absolute coordinates comes back magnified.
constexpr double kNearPivot = 0.1;
constexpr double kFarAgain = 1.5;      // times that: far enough
constexpr double kAcrossShrink = 0.1;  // of the steps before: they have shrunk
constexpr double kAcrossGrowth = 1.3;  // of each further step across, where one did not lead out
constexpr int kMostAcross = 6;         // of growing length
// Of a contact's transition zone, per step on the way out: the watch of contacts sees kinks that
// are an eighth of it apart.
constexpr double kZonePart = 0.5;
constexpr double kNearEnd = 0.01;  // of what is left of a step behind an event: kept when it is cut
constexpr int kMostCuts = 5;  // of a step to end at an event: each brings it some digits nearer

}  // namespace

// Near a state where constraints depend on one another steps are taken by method partitioned, which
// meets them at every stage.
void Integration::SwitchNearDependence() {
  const double pivot = dynamics_.SmallestPivot(nullptr);
  largest_pivot_ = std::max(largest_pivot_, pivot);
  if (is_near_ ? pivot < kFarAgain * kNearPivot * largest_pivot_
               : pivot >= kNearPivot * largest_pivot_) {
    return;
  }
  is_near_ = !is_near_;
  if (is_near_) ++report_.near_dependence;
  if (role_ == StepperSet::kPartitioned) return;
  std::copy_n(stepper_->state(), sample_.size(), start_.begin());
  stepper_ = steppers_.Get(is_near_ ? StepperSet::kPartitioned : role_);
  stepper_->Start(t_, start_);
}

// The motion goes smoothly through a state where constraints depend on one another; what its
// neighbourhood spoils is the estimate of the error, and the shorter the steps the nearer they
// come. So where steps have shrunk there, one of the length that was good before is taken across.
void Integration::StepAcross(double* h) {
  if (!is_near_ || *h > kAcrossShrink * longest_ || crossings_ >= kMostAcross) {
    across_ = false;
    return;
  }
  across_ = true;
  ++crossings_;
  *h = std::min(longest_ * std::pow(kAcrossGrowth, crossings_ - 1), end_ - t_);
}

void Integration::NextStep(double error, double* h) {
  const int order = stepper_->ErrorOrder();
  const double exponent = (1.0 - 0.75 * kMemory) / order, memory = kMemory / order;
  const double wanted =
      std::pow(std::max(error, 1e-10), exponent) / std::pow(last_error_, memory) / kSafety;
  const double factor = std::clamp(wanted, 1.0 / kMostGrowth, 1.0 / kMostStepShrink);
  last_error_ = std::max(error, 1e-4);
  limit_ = factor > wanted ? StepLimit::kGrowth
           : stable_       ? StepLimit::kError
                           : StepLimit::kStability;
  *h /= factor;
  const double contact = ContactStep();
  if (contact < *h) {
    *h = contact;
    limit_ = StepLimit::kContactExit;
  }
  if (options_.max_step < *h) {
    *h = options_.max_step;
    limit_ = StepLimit::kMaxStep;
  }
  KeepWithinEdge(h);
  SeeEffects(h);
}

void Integration::SeeEffects(double* h) {
  if (model_.linear_springs.count() == 0 && tables_.empty()) return;
  const Motion motion = dynamics_.MotionAt(t_, stepper_->state());
  const double least = scale_.rtol * scale_.length;
  double seen = std::min(*h, model_.linear_springs.LongestStep(motion, least));
  if (!tables_.empty()) seen = tables_.Resolved(motion, seen);
  if (seen < *h) limit_ = StepLimit::kError;
  *h = seen;
}

void Integration::Shrink(double error, double* h) {
  const double factor =
      std::isfinite(error)
          ? std::max(kMostStepShrink, kSafety * std::pow(error, -1.0 / stepper_->ErrorOrder()))
          : 0.1;
  *h *= factor;
  limit_ = stable_ ? StepLimit::kError : StepLimit::kStability;
  if (*h > kSmallestStep * std::max(t_, options_.time) || FailIfDependent()) return;
  std::string cause;
  for (const double ahead : {0.0, 10.0 * *h, kFunctionsAhead * options_.time}) {
    if (cause.empty()) cause = model_.FaultyFunctions(t_ + ahead);
  }
  if (!cause.empty()) cause = "; not finite near here: " + cause;
  Fail(std::isfinite(error) ? SimulateStatus::kStepTooSmall : SimulateStatus::kNotFinite,
       fmt::format("the step shrank to {:.1e} s, worst at {}{}", *h,
                   NameOfRigidBody(model_, stepper_->WorstBody()), cause));
}

// Within an implicit step its velocities are a cubic's, off by h^3 where both ends have the
// tolerance's error, and within a step at the edge of stability what is stiff is off by no power of
// h: in proportion to the distance from the nearer end, as that goes to zero. The event's time is
// off likewise, so a cut step is looked at like any other.
bool Integration::EndAtEvent(double* h) {
  const bool at_edge = role_ == StepperSet::kAtEdge;
  if ((role_ != StepperSet::kImplicit && !at_edge) || is_near_ || cuts_ >= kMostCuts) return false;
  double sigma = 1.0;
  const bool event = finder_.FindFirst(*stepper_, dynamics_.modes(), &sigma);
  if (!event || stepper_->DenseDoubt(sigma) <= 1.0 || sigma * *h < LeastStep()) {
    // What looked within the step was the right side's last place.
    if (at_edge && stepper_->DenseIsFree()) stepper_->RefreshTrial();
    return false;
  }
  ++cuts_;
  *h *= sigma + kNearEnd * (1.0 - sigma);
  stepper_->Drop();
  ++report_.rejected;
  limit_ = StepLimit::kEvent;
  return true;
}

// What a step's error counts, in errors of steps at any other time.
double Integration::WeightOfImpact() {
  if (impacts_.empty()) return 1.0;
  return impacts_.Weight(t_, dynamics_.MotionAt(t_, stepper_->state()), dynamics_.modes());
}

// The longest step that does not step over the end of a contact. Where f is held at zero nothing
// slows the steps down, and yet f comes back for an instant in the law's transition
// zone, between two stages of a long step.
double Integration::ContactStep() const {
  double longest = HUGE_VAL;
  for (int k = 0; k < model_.latches.count(); ++k) {
    const LatchMode mode = dynamics_.modes()[k];
    if (!(mode.upper_contact | mode.lower_contact)) continue;
    const double zone = model_.latches.law(k).ReturnDepth();
    if (!(zone > 0.0)) continue;
    const Motion motion = dynamics_.MotionAt(t_, stepper_->state());
    const double theta = model_.latches.hinge(k).Theta(motion);
    const double rate = model_.latches.hinge(k).Rate(motion);
    for (const bool upper : {true, false}) {
      if (!(upper ? mode.upper_contact : mode.lower_contact)) continue;
      const Latches::Contact c = model_.latches.At(k, upper, theta, rate);
      if (role_ != StepperSet::kImplicit && c.depth_rate > 0.0 && c.depth < zone) {
        // On the way in the damping ends in an edge: a step that goes over it sees neither side.
        // Implicit steps are solved for what the contact is at their end.
        constexpr double kLeast = 1e-3;  // of the zone: the edge itself is passed
        longest = std::min(longest,
                           std::max(zone - std::max(0.0, c.depth), kLeast * zone) / c.depth_rate);
      }
      if (c.depth_rate >= 0.0 || c.depth <= 0.0) continue;
      longest = std::min(longest, std::max(c.depth - zone, kZonePart * zone) / -c.depth_rate);
    }
  }
  return longest;
}

}  // namespace unfurl::sim
