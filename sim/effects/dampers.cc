#include "sim/effects/dampers.h"

namespace unfurl::sim {

void Dampers::Add(const Coordinate& coordinate, double damping) {
  coordinates_.push_back(coordinate);
  damping_.push_back(damping);
}

double Dampers::Moment(int k, const Motion& motion) const {
  return -damping_[k] * coordinates_[k].Rate(motion);
}

void Dampers::AddLoad(const Motion& motion, Load load, double* lost) const {
  for (int k = 0; k < count(); ++k) {
    const double rate = coordinates_[k].Rate(motion), moment = -damping_[k] * rate;
    coordinates_[k].Apply(motion, moment, load);
    if (lost != nullptr) *lost -= moment * rate;
  }
}

}  // namespace unfurl::sim
