#pragma once

#include "sim/effects/effect.h"
#include "sim/model/aligned.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// A uniform field: force m g on every body's centre of mass.
class Gravity {
 public:
  static constexpr EffectText kText = {"gravity", "gravity", "energy in the field of gravity"};
  static constexpr PowerKind kPower = PowerKind::kNone;

  Gravity() = default;
  Gravity(const Array& mass, double gx, double gy);  // mass by body [kg]; g [m/s^2]
  int count() const { return count_; }               // bodies with a mass
  bool HasPower() const { return false; }

  void AddLoad(const Motion& motion, Load load, double* power) const;
  // The force is the same everywhere.
  void AddTangent(const Motion&, Tangent*) const {}
  double Energy(const Motion& motion) const;               // -sum m g.r [J]
  double EnergyScale(const Motion&) const { return 0.0; }  // its zero is at the world's origin

 private:
  Array mass_;                  // by body [kg]
  double gx_ = 0.0, gy_ = 0.0;  // [m/s^2]
  int count_ = 0;
};

}  // namespace unfurl::sim
