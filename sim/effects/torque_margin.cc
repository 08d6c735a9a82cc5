#include "sim/effects/torque_margin.h"

#include <cmath>

namespace unfurl::sim {

void TorqueMargins::Watch(const Motion& motion, const std::vector<LatchMode>& modes) {
  for (std::size_t j = 0; j < margins_.size(); ++j) {
    const Model::Joint& joint = model_.joints[j];
    if (joint.latch < 0 || modes[static_cast<std::size_t>(joint.latch)].latched) continue;
    double driving = 0.0, resisting = 0.0;
    const auto add = [&](double moment) {
      (moment < 0.0 ? driving : resisting) += std::fabs(moment);
    };
    ForEachJointEffect(model_.joint_effects, [&](const auto& effect, std::size_t index) {
      const int k = joint.effects[index];
      if (k >= 0) add(effect.MarginMoment(k, motion));
    });
    const double theta = joint.coordinate.hinge.Theta(motion);
    TorqueMargin& margin = margins_[j];
    if (driving < margin.least_driving) {
      margin.least_driving = driving;
      margin.least_theta = theta;
    }
    if (resisting > 0.0 && driving / resisting < margin.ratio) {
      margin.ratio = driving / resisting;
      margin.ratio_theta = theta;
    }
  }
}

}  // namespace unfurl::sim
