#include "sim/effects/springs.h"

namespace unfurl::sim {

void Springs::Add(const Coordinate& coordinate, double stiffness, double preload) {
  coordinates_.push_back(coordinate);
  stiffness_.push_back(stiffness);
  preload_.push_back(preload);
}

double Springs::Moment(int k, const Motion& motion) const {
  return -stiffness_[k] * (coordinates_[k].Value(motion) + preload_[k]);
}

void Springs::AddLoad(const Motion& motion, Load load) const {
  for (int k = 0; k < count(); ++k) coordinates_[k].Apply(motion, Moment(k, motion), load);
}

double Springs::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (int k = 0; k < count(); ++k) {
    const double stretch = coordinates_[k].Value(motion) + preload_[k];
    sum += 0.5 * stiffness_[k] * stretch * stretch;
  }
  return sum;
}

}  // namespace unfurl::sim
