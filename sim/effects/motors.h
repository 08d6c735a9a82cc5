#pragma once

#include <vector>

#include "data/time_function.h"
#include "sim/model/coordinate.h"

namespace unfurl::sim {

class Tangent;

// Motors: a moment on a joint's coordinate as a function of time, whatever the joint does.
class Motors {
 public:
  void Add(const Coordinate& coordinate, const data::TimeFunction& moment);
  int count() const { return static_cast<int>(coordinates_.size()); }

  // Adds the power delivered to `work` [W], where given.
  void AddLoad(const Motion& motion, Load load, double* work) const;
  void AddTangent(const Motion& motion, Tangent* tangent) const;
  double Moment(int k, const Motion& motion) const { return moment_[k].Value(motion.t); }  // [N m]
  const data::TimeFunction& moment(int k) const { return moment_[k]; }
  const Coordinate& coordinate(int k) const { return coordinates_[k]; }

 private:
  std::vector<Coordinate> coordinates_;
  std::vector<data::TimeFunction> moment_;  // [N m]
};

}  // namespace unfurl::sim
