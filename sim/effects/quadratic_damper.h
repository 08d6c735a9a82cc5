#pragma once

#include <cmath>

#include "data/scene.h"
#include "sim/effects/joint_effect.h"

namespace unfurl::sim {

// Moment -c |d(theta)/dt| d(theta)/dt on theta: the drag of a fluid at speed.
class QuadraticDamper {
 public:
  using Record = data::SceneQuadraticDamper;
  static constexpr EffectText kText = {"quadratic dampers", nullptr, nullptr};
  static constexpr PowerKind kPower = PowerKind::kDissipated;
  static constexpr const char* kKey = "quadratic_damper";
  static constexpr const char* kOf = "of the quadratic damper";

  explicit QuadraticDamper(const Record& record) : damping_(record.damping) {}

  double Moment(const JointInstant& at) const { return -damping_ * std::fabs(at.rate) * at.rate; }
  MomentSlopes Slopes(const JointInstant& at) const {
    return {0.0, -2.0 * damping_ * std::fabs(at.rate)};
  }
  double Energy(const JointInstant&) const { return 0.0; }
  double MarginMoment(const JointInstant& at) const { return Moment(at); }
  const data::TimeFunction* Function() const { return nullptr; }

 private:
  double damping_;  // c [N m s^2/rad^2]
};

}  // namespace unfurl::sim
