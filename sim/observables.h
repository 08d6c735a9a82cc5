#pragma once

#include <string>
#include <vector>

#include "data/run.h"
#include "sim/dynamics.h"
#include "sim/model.h"

namespace unfurl::sim {

struct PointMotion {
  double x, y, vx, vy;  // [m], [m/s]
};
PointMotion MotionOf(const Model& model, const MovingPoint& point, const double* state);

// Moment of contact on the angle of one latch's joint [N m].
double LatchMoment(const Model& model, int latch, const double* state, const LatchMode& mode);

// "beam 'beam1', segment 3", "body 'hub'".
std::string NameOfSlot(const Model& model, int slot);

// Every sampled quantity of a run, in the order of its columns: marks, joints, bodies, energies,
// momentum, centre of mass, drift of the constraints.
class Observables {
 public:
  explicit Observables(const Model& model);

  const std::vector<data::Quantity>& quantities() const { return quantities_; }
  // One row; the energies' residual is against the first call. `state` gets its stations filled.
  const std::vector<double>& Row(double t, double* state, const std::vector<LatchMode>& modes);
  const Balance& balance() const { return balance_; }  // of the last row
  double energy_at_start() const { return start_; }

 private:
  void Declare();

  const Model& model_;
  Dynamics dynamics_;
  Balance balance_;
  double start_ = 0.0;
  bool started_ = false;
  std::vector<data::Quantity> quantities_;
  std::vector<double> row_;
};

}  // namespace unfurl::sim
