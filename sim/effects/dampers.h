#pragma once

#include <vector>

#include "sim/model/coordinate.h"

namespace unfurl::sim {

class Tangent;

// Dampers on joints' coordinates: moment -c d(theta)/dt on theta, or the like force on a travel.
class Dampers {
 public:
  void Add(const Coordinate& coordinate, double damping);
  int count() const { return static_cast<int>(coordinates_.size()); }
  const Coordinate& coordinate(int k) const { return coordinates_[k]; }
  double damping(int k) const { return damping_[k]; }  // [N m s/rad]

  // Adds c (d(theta)/dt)^2 to `lost` [W], where given.
  void AddLoad(const Motion& motion, Load load, double* lost) const;
  double Moment(int k, const Motion& motion) const;  // on theta [N m]
  void AddTangent(const Motion& motion, Tangent* tangent) const;

 private:
  std::vector<Coordinate> coordinates_;
  std::vector<double> damping_;  // [N m s/rad]
};

}  // namespace unfurl::sim
