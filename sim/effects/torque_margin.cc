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
    if (joint.spring >= 0) add(model_.springs.Moment(joint.spring, motion));
    if (joint.table >= 0) add(model_.tables.Moment(joint.table, motion));
    if (joint.motor >= 0) add(model_.motors.Moment(joint.motor, motion));
    if (joint.damper >= 0) add(model_.dampers.Moment(joint.damper, motion));
    if (joint.friction >= 0) resisting += model_.frictions.largest(joint.friction);
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
