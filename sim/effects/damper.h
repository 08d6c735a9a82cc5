#pragma once

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// Moment -c d(theta)/dt on theta.
class Damper {
 public:
  using Record = data::SceneDamper;
  static constexpr EffectText kText = {"dampers", nullptr, nullptr};
  static constexpr PowerKind kPower = PowerKind::kDissipated;
  static constexpr const char* kKey = "damper";
  static constexpr const char* kOf = "of the damper";

  explicit Damper(const Record& record) : damping_(record.damping) {}

  double Moment(const JointInstant& at) const { return -damping_ * at.rate; }
  MomentSlopes Slopes(const JointInstant&) const { return {0.0, -damping_}; }
  double Energy(const JointInstant&) const { return 0.0; }
  double MarginMoment(const JointInstant& at) const { return Moment(at); }
  const data::TimeFunction* Function() const { return nullptr; }

 private:
  double damping_;  // c [N m s/rad]
};

}  // namespace unfurl::sim
