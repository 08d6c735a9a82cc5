#pragma once

#include <vector>

#include "sim/model/coordinate.h"

namespace unfurl::sim {

class Tangent;

// Springs on joints' coordinates: moment -K_t (theta + theta_pre) on theta, [paper, eq. (25)], or
// the like force on a travel.
class Springs {
 public:
  void Add(const Coordinate& coordinate, double stiffness, double preload);
  int count() const { return static_cast<int>(coordinates_.size()); }

  void AddLoad(const Motion& motion, Load load) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  double Moment(int k, const Motion& motion) const;  // on theta [N m]
  double Energy(const Motion& motion) const;         // K_t (theta + theta_pre)^2 / 2 [J]

 private:
  std::vector<Coordinate> coordinates_;
  std::vector<double> stiffness_;  // [N m/rad]
  std::vector<double> preload_;    // [rad]
};

}  // namespace unfurl::sim
