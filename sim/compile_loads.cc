// Springs between points, and forces from outside.
#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "sim/compiler.h"

namespace unfurl::sim {

void Compiler::RefuseInsideSmoothBeam(const data::SceneEnd& end, const std::string& name,
                                      const std::string& where) const {
  if (end.kind != data::SceneEnd::Kind::kAlongBeam) return;
  if (scene_.beams[end.index].model == data::BeamModel::kSegments) return;
  throw Error(
      fmt::format("'{}' acts inside the smooth beam '{}'", name, scene_.beams[end.index].name),
      where, "use model = \"segments\", or let it act on an end of the beam");
}

LoadPoint Compiler::LoadPointOf(const data::SceneEnd& end, double* angle) {
  const MovingPoint p = PointOf(end, angle);
  return {p.slot, p.px, p.py, p.other_slot, p.other_px};
}

void Compiler::FillLinearSprings() {
  for (const data::SceneLinearSpring& spring : scene_.linear_springs) {
    for (const data::SceneEnd* end : {&spring.a, &spring.b}) {
      RefuseInsideSmoothBeam(*end, spring.name, spring.where);
    }
    double angle = 0.0;
    const LoadPoint a = LoadPointOf(spring.a, &angle), b = LoadPointOf(spring.b, &angle);
    const PlanePose at_a = start_.node[NodeOf(spring.a)] * InNode(spring.a);
    const PlanePose at_b = start_.node[NodeOf(spring.b)] * InNode(spring.b);
    const double distance = std::hypot(at_b.x - at_a.x, at_b.y - at_a.y);
    if (spring.damping > 0.0 && !(distance > 0.0)) {
      throw Error(
          fmt::format("the ends of spring '{}' meet at the start: its damper has no line to "
                      "act along",
                      spring.name),
          spring.where, "move one of the points, or leave the damping out");
    }
    model_.linear_springs.Add(a, b, spring.stiffness, spring.damping,
                              spring.free_length.value_or(distance));
    model_.linear_spring_names.push_back(spring.name);
  }
}

void Compiler::FillForces() {
  for (const data::SceneForce& force : scene_.forces) {
    RefuseInsideSmoothBeam(force.on, force.name, force.where);
    double angle = 0.0;
    switch (force.kind) {
      case data::SceneForce::Kind::kForce: {
        const LoadPoint point = LoadPointOf(force.on, &angle);
        model_.forces.AddForce(point, force.force, force.follows, angle);
        break;
      }
      case data::SceneForce::Kind::kTorque:
        model_.forces.AddTorque(LoadPointOf(force.on, &angle), force.torque);
        model_.functions.push_back({force.torque, 0});
        continue;
      case data::SceneForce::Kind::kPerLength: {
        const data::SceneBeam& beam = scene_.beams[force.on.index];
        model_.forces.AddPerLength(first_segment_[force.on.index], beam.segments,
                                   beam.length / beam.segments, force.force, force.follows);
      }
    }
    for (const data::TimeFunction& f : force.force) model_.functions.push_back({f, 0});
  }
}

}  // namespace unfurl::sim
