#include "sim/effects/frictions.h"

#include <cmath>

namespace unfurl::sim {

void Frictions::Add(const Coordinate& coordinate, double moment, double creep_rate) {
  coordinates_.push_back(coordinate);
  moment_.push_back(moment);
  creep_rate_.push_back(creep_rate);
}

double Frictions::Moment(int k, const Motion& motion) const {
  return -moment_[k] * std::tanh(coordinates_[k].Rate(motion) / creep_rate_[k]);
}

double Frictions::Damping(int k, const Motion& motion) const {
  const double part = std::tanh(coordinates_[k].Rate(motion) / creep_rate_[k]);
  return moment_[k] / creep_rate_[k] * (1.0 - part * part);
}

void Frictions::AddLoad(const Motion& motion, Load load, double* lost) const {
  for (int k = 0; k < count(); ++k) {
    const double rate = coordinates_[k].Rate(motion);
    const double moment = -moment_[k] * std::tanh(rate / creep_rate_[k]);
    coordinates_[k].Apply(motion, moment, load);
    if (lost != nullptr) *lost -= moment * rate;
  }
}

}  // namespace unfurl::sim
