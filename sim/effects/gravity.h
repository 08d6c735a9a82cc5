#pragma once

#include "sim/model/aligned.h"
#include "sim/model/slots.h"

namespace unfurl::sim {

// A uniform field: force m g on every slot's centre of mass.
class Gravity {
 public:
  Gravity() = default;
  Gravity(const Array& mass, double gx, double gy);  // mass by slot [kg]; g [m/s^2]
  bool empty() const { return mass_.empty(); }
  int count() const;

  void AddLoad(Load load) const;
  double Energy(const Motion& motion) const;  // -sum m g.r [J]

 private:
  Array mass_;
  double gx_ = 0.0, gy_ = 0.0;
};

}  // namespace unfurl::sim
