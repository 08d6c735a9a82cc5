#include "sim/dynamics/dynamics.h"

namespace unfurl::sim {

void Dynamics::FillTangent(double t, double* y, const double* lambda, Tangent* tangent) const {
  const Motion motion = MotionAt(t, y);
  const bool note = tangent->empty();
  if (note) *tangent = Tangent(model_.rigid_bodies);
  tangent->Begin(note);
  if (model_.bending.count() > 0) model_.bending.AddTangent(motion, tangent);
  ForEachEffect(model_, [&](const auto& effect) {
    if (effect.count() > 0) effect.AddTangent(motion, tangent);
  });
  if (model_.constraints.count() > 0) {
    model_.constraints.AddTangent(motion, work_, lambda, tangent);
  }
  tangent->FoldStations(fx_.data(), fy_.data(), work_.fx.data(), work_.fy.data(),
                        work_.station.data());
}

void Dynamics::ForcesOnBodies(double* fx, double* fy) const {
  for (int k = 0; k < model_.rigid_bodies.count; ++k) {
    fx[k] = fx_[k] + work_.fx[k];
    fy[k] = fy_[k] + work_.fy[k];
  }
}

}  // namespace unfurl::sim
