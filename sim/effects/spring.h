#pragma once

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// Moment -K_t (theta + theta_pre) on theta, [paper, eq. (25)].
class Spring {
 public:
  using Record = data::SceneSpring;
  static constexpr EffectText kText = {"springs", "spring", "energy of the torsion springs"};
  static constexpr PowerKind kPower = PowerKind::kNone;
  static constexpr const char* kKey = "spring";
  static constexpr const char* kOf = "of the spring";

  explicit Spring(const Record& record) : stiffness_(record.stiffness), preload_(record.preload) {}

  double Moment(const JointInstant& at) const { return -stiffness_ * (at.value + preload_); }
  MomentSlopes Slopes(const JointInstant&) const { return {-stiffness_, 0.0}; }
  double Energy(const JointInstant& at) const {
    const double stretch = at.value + preload_;
    return 0.5 * stiffness_ * stretch * stretch;
  }
  double MarginMoment(const JointInstant& at) const { return Moment(at); }
  const data::TimeFunction* Function() const { return nullptr; }

 private:
  double stiffness_;  // K_t [N m/rad]
  double preload_;    // theta_pre [rad]
};

}  // namespace unfurl::sim
