#pragma once

#include "data/scene.h"

namespace unfurl::sim {

// A pin that turns a segmented beam's own end with a moment (spring, latch, drive, ...), a slider
// on it, and a weld of two beams need a station at the end with a half element, or the end
// converges in first order only. So such an end gets a small rigid body of its own, welded to it: a
// quarter of a segment's mass and half of a segment's inertia; the beam gives the mass up
// (SegmentMass), and total mass and its first moment stay what they were (for one segment alone,
// the mass only). Returns the scene with those bodies, called BEAM.start and BEAM.end.
data::Scene WithEndBodies(const data::Scene& scene);

// Whether a joint transmits a moment to what it joins.
bool CarriesMoment(const data::SceneJoint& joint);

// Mass of segment k of a beam, and before its ends gave some up [kg].
double ShareOf(const data::SceneBeam& beam, int k);
double SegmentMass(const data::SceneBeam& beam, int k);

}  // namespace unfurl::sim
