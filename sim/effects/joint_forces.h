#pragma once

#include <vector>

#include "sim/model/model.h"

namespace unfurl::sim {

// What the constraints do at the joints, from the multipliers.
class JointForces {
 public:
  struct Force {
    double fx = 0.0, fy = 0.0;  // of the inner side on the outer, in the world; a drive's apart [N]
    double hold = 0.0;          // moment that keeps a slider from turning, on outer [N m]
    double drive = 0.0;         // of a drive, on the joint's coordinate [N m], or [N] on a travel
  };

  explicit JointForces(const Model& model);
  // `multipliers`: Dynamics::JointMultipliers; `motion` with cosines and sines.
  Force Of(int joint, const Motion& motion, const double* multipliers) const;

  bool driven(int joint) const { return rows_[static_cast<std::size_t>(joint)].drive >= 0; }
  bool held(int joint) const { return rows_[static_cast<std::size_t>(joint)].hold >= 0; }

 private:
  struct Rows {  // of the multipliers; -1: none
    int pin = -1, normal = -1, hold = -1, drive = -1;
  };
  const Model& model_;
  std::vector<Rows> rows_;  // by joint
};

}  // namespace unfurl::sim
