#pragma once

#include <array>
#include <memory>
#include <string>

#include "sim/methods/simulate.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

// The steppers that a run may take steps with, made when first wanted.
class StepperSet {
 public:
  enum Role {
    kPair,         // explicit, of the order that options and tolerance ask for
    kAtEdge,       // explicit, of order eight: where stability limits a pair of order five
    kImplicit,     //
    kPartitioned,  // asked for, or where constraints nearly depend on one another
    kRoles
  };

  StepperSet(const SimulateOptions& options, Dynamics& dynamics, const ErrorScale& scale)
      : options_(options), dynamics_(dynamics), scale_(scale), explicit_rtol_(scale.rtol) {}

  static Role RoleOf(Method method);
  // Whether kAtEdge is another pair than kPair.
  bool HasEdgePair() const;
  Stepper* Get(Role role);
  // Of explicit steps, where it is to be another than the run's [-].
  void SetExplicitTolerance(double rtol);
  // Of all that were made.
  long evaluations() const;
  long repartitions() const;
  // The method in words: the one begun with, and others with the percentage of the time that they
  // took, those of some account.
  std::string Description(Role begun_with) const;
  void NoteTime(Role role, double gained) { time_[role] += gained; }  // [s]

 private:
  const SimulateOptions& options_;
  Dynamics& dynamics_;
  ErrorScale scale_;
  double explicit_rtol_;  // [-]
  std::array<std::unique_ptr<Stepper>, kRoles> steppers_;
  std::array<double, kRoles> time_{};  // gone through [s]
};

}  // namespace unfurl::sim
