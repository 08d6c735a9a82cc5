// Springs between points, and forces from outside.
#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "sim/model/compiler.h"

namespace unfurl::sim {

LoadPoint Compiler::LoadPointOf(const data::SceneEnd& end, double* angle) {
  const MovingPoint p = PointOf(end, angle);
  return {p.body, p.px, p.py, p.other_body, p.other_px, p.other_share};
}

void Compiler::FillLinearSprings() {
  for (const data::SceneLinearSpring& spring : scene_.linear_springs) {
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
        const bool smooth = IsSmooth(force.on.index);
        if (smooth && force.follows) {
          throw Error(fmt::format("'{}' turns with the smooth beam '{}'", force.name, beam.name),
                      force.where, "use frame = \"world\", or model = \"segments\"");
        }
        if (smooth && !beam.section.uniform()) {
          throw Error(fmt::format("'{}' acts all along the tapered smooth beam '{}'", force.name,
                                  beam.name),
                      force.where, "use model = \"segments\" for it, or forces at places");
        }
        // On a smooth beam it acts as one force on the centre of mass does.
        const int parts = smooth ? 1 : beam.segments;
        model_.forces.AddPerLength(first_segment_[force.on.index], parts, beam.length / parts,
                                   force.force, force.follows);
      }
    }
    for (const data::TimeFunction& f : force.force) model_.functions.push_back({f, 0});
  }
}

}  // namespace unfurl::sim
