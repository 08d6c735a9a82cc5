#include "sim/effects/motors.h"

namespace unfurl::sim {

void Motors::Add(const Coordinate& coordinate, const data::TimeFunction& moment) {
  coordinates_.push_back(coordinate);
  moment_.push_back(moment);
}

void Motors::AddLoad(const Motion& motion, Load load, double* work) const {
  for (int k = 0; k < count(); ++k) {
    const double moment = Moment(k, motion);
    coordinates_[k].Apply(motion, moment, load);
    if (work != nullptr) *work += moment * coordinates_[k].Rate(motion);
  }
}

}  // namespace unfurl::sim
