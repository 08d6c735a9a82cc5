#include "sim/effects/linear_springs.h"

#include <cmath>

namespace unfurl::sim {

void LinearSprings::Add(const LoadPoint& a, const LoadPoint& b, double stiffness, double damping,
                        double free_length) {
  springs_.push_back({a, b, stiffness, damping, free_length});
  damped_ |= damping > 0.0;
}

LinearSprings::State LinearSprings::At(int k, const Motion& motion) const {
  const Spring& s = springs_[k];
  const LoadPoint::At a = s.a.Place(motion), b = s.b.Place(motion);
  const double dx = b.x - a.x, dy = b.y - a.y, length = std::sqrt(dx * dx + dy * dy);
  const double inverse = length > 0.0 ? 1.0 / length : 0.0;
  State state{length, 0.0, 0.0, dx * inverse, dy * inverse};
  state.rate = state.ex * (b.vx - a.vx) + state.ey * (b.vy - a.vy);
  state.tension = s.stiffness * (length - s.free_length) + s.damping * state.rate;
  return state;
}

void LinearSprings::AddLoad(const Motion& motion, Load load, double* lost) const {
  for (int k = 0; k < count(); ++k) {
    const State s = At(k, motion);
    const double fx = s.tension * s.ex, fy = s.tension * s.ey;
    springs_[k].a.Apply(motion, fx, fy, load);
    springs_[k].b.Apply(motion, -fx, -fy, load);
    if (lost != nullptr) *lost += springs_[k].damping * s.rate * s.rate;
  }
}

double LinearSprings::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (int k = 0; k < count(); ++k) {
    const double stretch = At(k, motion).length - springs_[k].free_length;
    sum += 0.5 * springs_[k].stiffness * stretch * stretch;
  }
  return sum;
}

}  // namespace unfurl::sim
