#pragma once

#include <vector>

#include "sim/model/coordinate.h"

namespace unfurl::sim {

class Tangent;

// Dry friction on joints' coordinates: moment -M tanh(d(theta)/dt / w) on theta. Below the creep
// rate w the joint does not stick but creeps; the moment does not depend on the load of the joint.
class Frictions {
 public:
  void Add(const Coordinate& coordinate, double moment, double creep_rate);
  int count() const { return static_cast<int>(coordinates_.size()); }
  const Coordinate& coordinate(int k) const { return coordinates_[k]; }

  // Adds the power that is lost to `lost` [W], where given.
  void AddLoad(const Motion& motion, Load load, double* lost) const;
  double Moment(int k, const Motion& motion) const;   // on theta [N m]
  double largest(int k) const { return moment_[k]; }  // M [N m]
  // -d(moment)/d(rate) [N m s/rad].
  double Damping(int k, const Motion& motion) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;

 private:
  std::vector<Coordinate> coordinates_;
  std::vector<double> moment_;      // [N m]
  std::vector<double> creep_rate_;  // [rad/s]
};

}  // namespace unfurl::sim
