#include "sim/springs.h"

namespace unfurl::sim {

void Springs::Add(const Hinge& hinge, double stiffness, double preload) {
  hinges_.push_back(hinge);
  stiffness_.push_back(stiffness);
  preload_.push_back(preload);
}

double Springs::Moment(int k, const Motion& motion) const {
  return -stiffness_[k] * (hinges_[k].Theta(motion) + preload_[k]);
}

void Springs::AddLoad(const Motion& motion, Load load) const {
  for (int k = 0; k < count(); ++k) hinges_[k].Apply(Moment(k, motion), load);
}

double Springs::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (int k = 0; k < count(); ++k) {
    const double stretch = hinges_[k].Theta(motion) + preload_[k];
    sum += 0.5 * stiffness_[k] * stretch * stretch;
  }
  return sum;
}

}  // namespace unfurl::sim
