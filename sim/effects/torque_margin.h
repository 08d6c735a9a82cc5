#pragma once

#include <limits>
#include <vector>

#include "sim/model/model.h"

namespace unfurl::sim {

// Margin of the moments that drive a latching joint towards closing (theta falls) over those that
// resist it, before it has latched: sums of JointLaw::MarginMoment of the joint's effects by sign.
// Friction counts with its whole moment, as if the joint were about to stop.
struct TorqueMargin {
  double ratio = std::numeric_limits<double>::infinity();          // least driving / resisting [-]
  double ratio_theta = 0.0;                                        // where [rad]
  double least_driving = std::numeric_limits<double>::infinity();  // [N m]
  double least_theta = 0.0;                                        // where [rad]

  bool seen() const { return least_driving < std::numeric_limits<double>::infinity(); }
  bool resisted() const { return ratio < std::numeric_limits<double>::infinity(); }
};

class TorqueMargins {
 public:
  explicit TorqueMargins(const Model& model) : model_(model), margins_(model.joints.size()) {}
  void Watch(const Motion& motion, const std::vector<LatchMode>& modes);
  const TorqueMargin& of(int joint) const { return margins_[static_cast<std::size_t>(joint)]; }

 private:
  const Model& model_;
  std::vector<TorqueMargin> margins_;  // by joint
};

}  // namespace unfurl::sim
