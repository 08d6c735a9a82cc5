#pragma once

#include <vector>

#include "sim/effects/effect.h"
#include "sim/model/aligned.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// Long vertical strings: force -(m g / L)(r - r_hang) on every centre of mass. Bodies welded
// together hang on a string each; since their moments about the common centre vanish to first
// order, they add to one force there and the moment -kappa sin(theta - theta_hang), with
// kappa = sum (m g / L) |offset|^2.
class Suspension {
 public:
  static constexpr EffectText kText = {"suspension", "suspension", "energy of the suspension"};
  static constexpr PowerKind kPower = PowerKind::kNone;

  Suspension() = default;
  explicit Suspension(int bodies);
  void Set(int body, double stiffness, double x_hang, double y_hang, double kappa,
           double theta_hang);
  int count() const { return count_; }
  bool HasPower() const { return false; }

  void AddLoad(const Motion& motion, Load load, double* power) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  double Energy(const Motion& motion) const;  // [J]
  double EnergyScale(const Motion& motion) const { return Energy(motion); }

 private:
  struct Turning {
    int body;
    double kappa;       // [N m]
    double theta_hang;  // [rad]
  };
  int count_ = 0;
  Array stiffness_;  // m g / L by body [N/m]
  Array x_, y_;      // r_hang by body [m]
  std::vector<Turning> turning_;
};

}  // namespace unfurl::sim
