#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {

void Dynamics::FillTangent(double t, double* y, const double* lambda, Tangent* tangent) const {
  const Motion motion = MotionAt(t, y);
  const bool note = tangent->empty();
  if (note) *tangent = Tangent(model_.slots);
  tangent->Begin(note);
  if (model_.bending.count() > 0) model_.bending.AddTangent(motion, tangent);
  if (model_.springs.count() > 0) model_.springs.AddTangent(motion, tangent);
  if (model_.dampers.count() > 0) model_.dampers.AddTangent(motion, tangent);
  if (model_.tables.count() > 0) model_.tables.AddTangent(motion, tangent);
  if (model_.frictions.count() > 0) model_.frictions.AddTangent(motion, tangent);
  if (model_.motors.count() > 0) model_.motors.AddTangent(motion, tangent);
  if (model_.linear_springs.count() > 0) model_.linear_springs.AddTangent(motion, tangent);
  if (model_.forces.count() > 0) model_.forces.AddTangent(motion, tangent);
  if (model_.latches.count() > 0) model_.latches.AddTangent(motion, modes_, tangent);
  if (model_.suspension.count() > 0) model_.suspension.AddTangent(motion, tangent);
  if (model_.constraints.count() > 0) {
    model_.constraints.AddTangent(motion, work_, lambda, tangent);
  }
  tangent->FoldStations(fx_.data(), fy_.data(), work_.fx.data(), work_.fy.data(),
                        work_.station.data());
}

}  // namespace unfurl::sim
