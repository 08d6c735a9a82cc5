#pragma once

#include <vector>

#include "sim/model/aligned.h"
#include "sim/model/slots.h"

namespace unfurl::sim {

class Tangent;

// Long vertical strings: force -(m g / L)(r - r_hang) on every centre of mass. Bodies welded
// together hang on a string each; since their moments about the common centre vanish to first
// order, they add to one force there and the moment -kappa sin(theta - theta_hang), with
// kappa = sum (m g / L) |offset|^2.
class Suspension {
 public:
  Suspension() = default;
  explicit Suspension(int slots);
  void Set(int slot, double stiffness, double x_hang, double y_hang, double kappa,
           double theta_hang);
  int count() const { return count_; }

  void AddLoad(const Motion& motion, Load load) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  double Energy(const Motion& motion) const;  // [J]

 private:
  struct Turning {
    int slot;
    double kappa;       // [N m]
    double theta_hang;  // [rad]
  };
  int count_ = 0;
  Array stiffness_, x_, y_;  // by slot
  std::vector<Turning> turning_;
};

}  // namespace unfurl::sim
