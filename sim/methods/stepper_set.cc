#include "sim/methods/stepper_set.h"

#include <fmt/format.h>

#include "sim/methods/make_stepper.h"

namespace unfurl::sim {
namespace {

constexpr double kWorthSaying = 0.005;  // of the run: a percent, rounded; lost trials are less

}  // namespace

StepperSet::Role StepperSet::RoleOf(Method method) {
  return method == Method::kImplicit      ? kImplicit
         : method == Method::kPartitioned ? kPartitioned
                                          : kPair;
}

bool StepperSet::HasEdgePair() const {
  return options_.method == Method::kAuto && PairOrder(options_) == 5;
}

Stepper* StepperSet::Get(Role role) {
  std::unique_ptr<Stepper>& stepper = steppers_[role];
  if (stepper != nullptr) return stepper.get();
  const Method method = role == kImplicit      ? Method::kImplicit
                        : role == kPartitioned ? Method::kPartitioned
                                               : Method::kProjected;
  SimulateOptions options = options_;
  if (role == kAtEdge) options.order = 8;
  stepper = MakeStepper(options, dynamics_, scale_, method);
  if (method == Method::kProjected) stepper->SetTolerance(explicit_rtol_);
  return stepper.get();
}

void StepperSet::SetExplicitTolerance(double rtol) {
  explicit_rtol_ = rtol;
  for (const Role role : {kPair, kAtEdge}) {
    if (steppers_[role] != nullptr) steppers_[role]->SetTolerance(rtol);
  }
}

long StepperSet::evaluations() const {
  long sum = 0;
  for (const auto& stepper : steppers_) sum += stepper == nullptr ? 0 : stepper->evaluations();
  return sum;
}

long StepperSet::repartitions() const {
  long sum = 0;
  for (const auto& stepper : steppers_) sum += stepper == nullptr ? 0 : stepper->repartitions();
  return sum;
}

std::string StepperSet::Description(Role begun_with) const {
  double all = 0.0;
  for (const double time : time_) all += time;
  std::string text = steppers_[begun_with]->Description();
  for (int role = 0; role < kRoles; ++role) {
    if (role == begun_with || role == kPartitioned || !(time_[role] > kWorthSaying * all)) continue;
    text += fmt::format("; {} for {:.0f}% of the time, where it is faster", steppers_[role]->name(),
                        100.0 * time_[role] / all);
  }
  return text;
}

}  // namespace unfurl::sim
