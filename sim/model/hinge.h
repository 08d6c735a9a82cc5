#pragma once

#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// The relative angle of a revolute joint: theta = sign (theta_outer - theta_inner - zero), with the
// angles of the two bodies; `zero` holds the scene's zero angle and how each end sits in its body.
struct Hinge {
  int inner = -1;  // bodies
  int outer = -1;
  double sign = 1.0;  // +1 or -1 [-]
  double zero = 0.0;  // [rad]

  double Theta(const Motion& m) const { return sign * (m.theta[outer] - m.theta[inner] - zero); }
  double Rate(const Motion& m) const { return sign * (m.omega[outer] - m.omega[inner]); }
  // A moment on theta, as moments on the two bodies [N m].
  void Apply(double moment, Load load) const {
    load.m[outer] += sign * moment;
    load.m[inner] -= sign * moment;
  }
};

}  // namespace unfurl::sim
