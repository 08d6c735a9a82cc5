#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "sim/dynamics/dynamics.h"
#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Whether nothing does work on the model.
bool IsClosed(const Model& model);

// Whether a run is credible, by a law that every motion of the model obeys: the balance of
// energy. The residual, stored + dissipated - work less its value at the start, is compared with
// the energy that moved: half the sum, over the kinds of energy, of the range of each, as what
// leaves one kind enters another. Where dissipation and work are not integrated, only growth of
// what is stored is found, and only in models on which nothing does work.
class RunJudge {
 public:
  // `tracked`: the states hold what was dissipated and done.
  RunJudge(const Model& model, const ErrorScale& scale, bool tracked);

  void Look(double t, const double* state, const std::vector<LatchMode>& modes);

  double Kinetic(double t, const double* state);  // [J]

  double residual() const { return residual_; }  // the largest magnitude [J]
  double residual_time() const { return at_; }   // [s]
  double moved() const;                          // [J]
  bool watches() const { return tracked_ || closed_; }
  // What neither rounding nor the tolerance, ten rtol of velocities and a speed, lets one tell
  // from nothing [J]. Where nothing but kinetic energy exists, it is what moves: its range is the
  // residual itself.
  double floor() const {
    const double kinetic = std::min(kTolerances * rtol_, kMostKinetic) * most_[0];
    return tolerance_floor_ + kinetic + kRoundingOfTerms * largest_term_;
  }
  // Empty where the balance holds.
  std::string Complaint() const;
  // Whether a stiff axis has taken so much of the balance that another method should go on: half
  // of what Complaint() allows it.
  bool AxisLosesBalance() const {
    return stiffest_axis_ >= 0 && IsOff(kShareOfAxis * kWarnTolerances);
  }
  // Of a run that is usable, but farther off than its tolerance promises; empty otherwise.
  std::string Warning() const;

 private:
  static constexpr int kKinds = 7 + kEffects;  // of energy
  // A balance is a sum of as many terms as there are bodies and elements, each computed to some
  // roundings of 1e-16 from angles that have turned for the whole run.
  static constexpr double kRoundingOfTerms = 1e-12;
  // Ten tolerances of a velocity, as every method keeps (docs/accuracy.md), are twenty of its
  // energy; never more than the share that is allowed of what moved.
  static constexpr double kTolerances = 20.0, kMostKinetic = 0.01;
  // Tolerances of what moved that are worth a warning: ten times the twenty that an energy is off
  // where velocities are off by ten, which is what methods keep (docs/accuracy.md).
  static constexpr double kWarnTolerances = 200.0;
  // What is lost before the change stays lost: it has to leave room for the rest of the run.
  static constexpr double kShareOfAxis = 0.5;

  // Farther than `tolerances` of what moved, beyond the floor.
  bool IsOff(double tolerances) const { return residual_ > tolerances * rtol_ * moved() + floor(); }
  bool IsLessAccurate() const { return IsOff(kWarnTolerances); }

  Dynamics dynamics_;
  const bool tracked_, closed_;
  const int stiffest_axis_;                      // beam; -1: none stretches
  const double rtol_;                            // [-]
  std::vector<double> state_;                    // [SI]
  std::array<double, kKinds> least_{}, most_{};  // by kind of energy [J]
  bool started_ = false;
  double start_ = 0.0, residual_ = 0.0, tolerance_floor_ = 0.0, largest_term_ = 0.0;  // [J]
  double at_ = 0.0;  // of the residual [s]
};

}  // namespace unfurl::sim
