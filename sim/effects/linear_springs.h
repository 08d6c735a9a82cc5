#pragma once

#include <vector>

#include "sim/effects/effect.h"
#include "sim/model/load_point.h"

namespace unfurl::sim {

// Springs and dampers between two points: tension k (d - d_0) + c d(d)/dt along the line between
// them, d their distance. They push as well as pull. Where the points meet there is no line and no
// force.
class LinearSprings {
 public:
  static constexpr EffectText kText = {"linear springs", "linear_spring",
                                       "energy of the linear springs"};
  static constexpr PowerKind kPower = PowerKind::kDissipated;

  void Add(const LoadPoint& a, const LoadPoint& b, double stiffness, double damping,
           double free_length);
  int count() const { return static_cast<int>(springs_.size()); }

  // Adds c (d(d)/dt)^2 to `lost` [W], where given.
  void AddLoad(const Motion& motion, Load load, double* lost) const;
  double Energy(const Motion& motion) const;  // k (d - d_0)^2 / 2 [J]
  double EnergyScale(const Motion& motion) const { return Energy(motion); }
  bool HasPower() const { return damped_; }

  struct State {
    double length;   // d [m]
    double rate;     // [m/s]
    double tension;  // [N]
    double ex, ey;   // from a to b, of length 1; zeros where the points meet [-]
  };
  State At(int k, const Motion& motion) const;
  // The longest step [s] in which no spring whose points nearly meet turns by more than half a
  // radian; its force jumps where they pass through one another, which takes steps of `least` [m].
  double LongestStep(const Motion& motion, double least) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;

 private:
  struct Spring {
    LoadPoint a, b;
    double stiffness;    // [N/m]
    double damping;      // [N s/m]
    double free_length;  // d_0 [m]
  };
  std::vector<Spring> springs_;
  bool damped_ = false;
};

}  // namespace unfurl::sim
