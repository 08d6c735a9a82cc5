#pragma once

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// A moment on the coordinate as a function of time, whatever the joint does.
class Motor {
 public:
  using Record = data::SceneMotor;
  static constexpr EffectText kText = {"motors", nullptr, nullptr};
  static constexpr PowerKind kPower = PowerKind::kWork;
  static constexpr const char* kKey = "motor";
  static constexpr const char* kOf = "of the motor";

  explicit Motor(const Record& record) : moment_(record.moment) {}

  double Moment(const JointInstant& at) const { return moment_.Value(at.t); }
  MomentSlopes Slopes(const JointInstant&) const { return {0.0, 0.0}; }
  double Energy(const JointInstant&) const { return 0.0; }
  double MarginMoment(const JointInstant& at) const { return Moment(at); }
  const data::TimeFunction* Function() const { return &moment_; }

 private:
  data::TimeFunction moment_;  // [N m]
};

}  // namespace unfurl::sim
