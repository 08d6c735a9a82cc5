#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sim/implicit/tangent.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// Energies by kind [J], momentum, and what the constraints have drifted, at one state.
struct Balance {
  double kinetic = 0.0, bending = 0.0, axial = 0.0;  // [J]
  std::array<double, kEffects> effects{};            // by effect, in the order of kEffectTexts [J]
  double effects_scale = 0.0;       // the same, wherever their zeros are (Effect::EnergyScale) [J]
  double dissipated_contact = 0.0;  // since the start, with what held contacts still have [J]
  double dissipated_beams = 0.0;    // since the start [J]
  double dissipated_dampers = 0.0;  // since the start, friction included [J]
  double work = 0.0;                // of drives, motors and applied forces, since the start [J]
  double momentum_x = 0.0, momentum_y = 0.0;          // [kg m/s]
  double angular_momentum = 0.0;                      // about the origin [kg m^2/s]
  double centre_x = 0.0, centre_y = 0.0;              // of all mass [m]
  double position_drift = 0.0, velocity_drift = 0.0;  // [m], [m/s]

  double Stored() const {
    double sum = kinetic + bending + axial;
    for (const double energy : effects) sum += energy;
    return sum;
  }
  // Of the stored energy, for tolerances.
  double Scale() const { return kinetic + bending + axial + effects_scale; }
  double Dissipated() const { return dissipated_contact + dissipated_beams + dissipated_dampers; }
  // Constant but for the error of the integration.
  double Conserved() const { return Stored() + Dissipated() - work; }
};

// The equations of motion of a model, with the work arrays of one simulation. The discrete modes of
// the latches are part of it: events change them, the right side only reads them.
class Dynamics {
 public:
  // Parts of the work, for profiles: the bodies' places, bending, the effects one by one, and the
  // constraints.
  enum Part {
    kKinematics,
    kBending,
    kFirstEffect,
    kConstraints = kFirstEffect + static_cast<int>(kEffects),
    kParts
  };
  static const char* PartName(int part);

  explicit Dynamics(const Model& model);

  const Model& model() const { return model_; }
  std::vector<LatchMode>& modes() { return modes_; }
  // Motion::holding from now on; it must outlive that.
  void HoldLatches(const double* stiffness) { holding_ = stiffness; }
  const std::vector<LatchMode>& modes() const { return modes_; }
  // Integrates what contacts and beams dissipate beside the motion (costs a few percent).
  bool track_energy = true;
  // Where given, kParts seconds, to which what each part takes is added (costs some 10%).
  double* profile = nullptr;

  // dydt of `y` (StateIndex layout, one spare block after it) at time t [s]. Fills the stations'
  // entries of y.
  void RightSide(double t, double* y, double* dydt);

  // Brings stations, cosines and sines up to date with y; the result points into y and this.
  Motion Update(double t, double* y);

  // Cosines and sines of the last RightSide or Update; no positions.
  Motion LastMotion() const {
    return {0.0,     nullptr, nullptr,        nullptr,     nullptr,
            nullptr, nullptr, cosine_.data(), sine_.data()};
  }
  // Multipliers of the joints' rows (JointRows), [N] and [N m]; of the last RightSide.
  const double* JointMultipliers() const {
    return work_.lambda.data() + model_.constraints.first_joint_row();
  }

  const double* Multipliers() const { return work_.lambda.data(); }  // by row

  // Functions of time that may jump are taken from within (after, before): a step from one edge to
  // the next sees no other piece of them.
  void SetInterval(double after, double before) {
    after_ = after;
    before_ = before;
  }

  // From here on it is always this time: loads are what they are then, and drives hold their place.
  void HoldAt(double t) {
    after_ = before_ = t;
    held_ = true;
  }

  // Drift of the constraints at the state of the last RightSide; needs no new factor.
  double PositionDrift(double t, double* y);
  double VelocityDrift(double t, double* y);
  // One mass-weighted Newton step on the positions and one on the velocities, with the factor of
  // the last RightSide, which must have been at `y`.
  void Project(double t, double* y);

  // For methods that keep the constraints themselves: the rows at y, or their rates, left in
  // constraint_rows(); return the largest [m], [m/s].
  double EvaluateConstraints(double t, double* y);
  double EvaluateConstraintRates(double t, double* y);
  double* constraint_rows() { return work_.drift.data(); }
  // At the y of the last RightSide or EvaluateConstraints; as Constraints::Jacobian.
  void Jacobian(double t, double* y, double* six_per_row) const;
  // The tangent of the last RightSide, which must have been at `y`; `lambda` are its multipliers by
  // row. An empty `tangent` is made first.
  void FillTangent(double t, double* y, const double* lambda, Tangent* tangent) const;
  // What acts on the bodies at the last RightSide, reactions of constraints included [N].
  void ForcesOnBodies(double* fx, double* fy) const;
  const Constraints::Work& constraint_work() const { return work_; }
  // The motion at y where the last RightSide was, stations included.
  Motion MotionAt(double t, double* y) const;

  Balance BalanceAt(double t, double* y);
  // Smallest pivot of the last factor relative to its diagonal entry; `where`, unless null,
  // gets the name of its joint.
  double SmallestPivot(std::string* where) const;

 private:
  double Within(double t) const { return std::min(std::max(t, after_), before_); }
  template <bool kProfile>
  void Evaluate(double t, double* y, double* dydt);

  const Model& model_;
  std::vector<LatchMode> modes_;
  Array cosine_, sine_, fx_, fy_, m_, scratch_;  // [-], [N], [N m]
  Constraints::Work work_;
  double after_ = -HUGE_VAL, before_ = HUGE_VAL;  // [s]
  bool held_ = false;
  const double* holding_ = nullptr;
};

}  // namespace unfurl::sim
