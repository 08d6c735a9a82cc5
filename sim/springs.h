#pragma once

#include <vector>

#include "sim/hinge.h"

namespace unfurl::sim {

// Torsion springs: moment -K_t (theta + theta_pre) on theta, [paper, eq. (25)].
class Springs {
 public:
  void Add(const Hinge& hinge, double stiffness, double preload);
  int count() const { return static_cast<int>(hinges_.size()); }

  void AddLoad(const Motion& motion, Load load) const;
  double Moment(int k, const Motion& motion) const;  // on theta [N m]
  double Energy(const Motion& motion) const;         // K_t (theta + theta_pre)^2 / 2 [J]

 private:
  std::vector<Hinge> hinges_;
  std::vector<double> stiffness_;  // [N m/rad]
  std::vector<double> preload_;    // [rad]
};

}  // namespace unfurl::sim
