#pragma once

#include <array>
#include <vector>

#include "data/time_function.h"
#include "sim/effects/effect.h"
#include "sim/model/load_point.h"

namespace unfurl::sim {

// Forces at points, torques, and forces per length along beams, as functions of time; components
// in the world's axes, or in those of the body or segment that they act on.
class Forces {
 public:
  static constexpr EffectText kText = {"forces", nullptr, nullptr};
  static constexpr PowerKind kPower = PowerKind::kWork;

  using Pair = std::array<data::TimeFunction, 2>;

  // `angle`: of the axes against the body's, where they follow it [rad].
  void AddForce(const LoadPoint& point, const Pair& force, bool follows, double angle);
  void AddTorque(const LoadPoint& point, const data::TimeFunction& torque);
  // On segments first to first + segments - 1, each of `length` [m]; the uniform load of a rigid
  // segment is one force at its middle.
  void AddPerLength(int first, int segments, double length, const Pair& per_length, bool follows);
  int count() const { return static_cast<int>(forces_.size() + torques_.size() + lines_.size()); }

  // Adds the power delivered to `work` [W], where given.
  void AddLoad(const Motion& motion, Load load, double* work) const;
  // Of forces at points that keep their direction; a follower has no symmetric stiffness to speak
  // of.
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  // Whether any that follows its body acts at that time [s].
  bool AnyFollows(double t) const;
  bool HasPower() const { return count() > 0; }
  double Energy(const Motion&) const { return 0.0; }
  double EnergyScale(const Motion&) const { return 0.0; }

 private:
  struct Force {
    LoadPoint point;
    Pair force;  // [N]
    bool follows;
    double c, s;  // of `angle` [-]
  };
  struct Torque {
    int body, other;
    double other_share;         // [-]
    data::TimeFunction torque;  // [N m]
  };
  struct Line {
    int first, segments;
    double length;    // [m]
    Pair per_length;  // [N/m]
    bool follows;
  };
  std::vector<Force> forces_;
  std::vector<Torque> torques_;
  std::vector<Line> lines_;
};

}  // namespace unfurl::sim
