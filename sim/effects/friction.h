#pragma once

#include <cmath>

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// Dry friction: moment -M tanh(d(theta)/dt / w) on theta. Below the creep rate w the joint does not
// stick but creeps; the moment does not depend on the load of the joint.
class Friction {
 public:
  using Record = data::SceneFriction;
  static constexpr EffectText kText = {"friction", nullptr, nullptr};
  static constexpr PowerKind kPower = PowerKind::kDissipated;
  static constexpr const char* kKey = "friction";
  static constexpr const char* kOf = "of dry friction";

  explicit Friction(const Record& record)
      : moment_(record.moment), creep_rate_(record.creep_rate) {}

  double Moment(const JointInstant& at) const {
    return -moment_ * std::tanh(at.rate / creep_rate_);
  }
  MomentSlopes Slopes(const JointInstant& at) const {
    const double part = std::tanh(at.rate / creep_rate_);
    return {0.0, -moment_ / creep_rate_ * (1.0 - part * part)};
  }
  double Energy(const JointInstant&) const { return 0.0; }
  // All of it, as if the joint were about to stop: a latch must close from there too.
  double MarginMoment(const JointInstant&) const { return moment_; }
  const data::TimeFunction* Function() const { return nullptr; }

 private:
  double moment_;      // M [N m]
  double creep_rate_;  // w [rad/s]
};

}  // namespace unfurl::sim
