#pragma once

#include <vector>

#include "data/scene.h"

namespace unfurl::sim {

// A place in the plane and a direction: p_out = (x, y) + R(angle) p.
struct PlanePose {
  double x = 0.0, y = 0.0, angle = 0.0;  // [m], [rad]
  PlanePose operator*(const PlanePose& inner) const;
  PlanePose Inverse() const;
};

// Bodies that are welded together without a beam between are one rigid body.
struct Composite {
  bool ground = false;
  std::vector<int> members;  // scene bodies, the first gives the frame's direction
  double mass = 0.0;         // [kg]
  double inertia = 0.0;      // about the common centre [kg m^2]
};

struct Composites {
  std::vector<Composite> list;     // the first is the ground, with what is welded to it
  std::vector<int> of_body;        // composite of each scene body
  std::vector<PlanePose> body_in;  // pose of each scene body in its composite (origin: its
                                   // centre of mass; the world's for the ground)
};

// Throws Error when welds contradict each other.
Composites MergeWeldedBodies(const data::Scene& scene);

bool IsBeamEnd(const data::SceneEnd& end);

// Whether a weld joins two bodies (or a body and the ground), no beam.
bool JoinsBodies(const data::SceneWeld& weld);

}  // namespace unfurl::sim
