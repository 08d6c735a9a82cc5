#pragma once

#include <array>
#include <string>
#include <vector>

#include "data/scene.h"
#include "sim/constraints/constraints.h"
#include "sim/effects/bending.h"
#include "sim/effects/effects.h"
#include "sim/kirchhoff/kirchhoff_beams.h"
#include "sim/methods/watches.h"
#include "sim/model/coordinate.h"
#include "sim/model/rigid_bodies.h"

namespace unfurl::sim {

// A point that moves with a body.
struct MovingPoint {
  int body = -1;
  double px = 0.0, py = 0.0;  // in the body's frame [m]
  // Along a beam of segments: between the places that the two give whose middles are nearest, by
  // its distance from these, so that angles and stretch are linear in between; -1: one body alone.
  int other_body = -1;
  double other_px = 0.0, other_share = 0.0;  // [m], [-]
  // Into KirchhoffBeams: a place along a smooth beam that has no body; -1: none.
  int watched = -1;
};

// A scene made ready to be simulated; immutable, so that several threads may share one. The effects
// that it holds are listed in sim/effects/effects.h.
struct Model : ModelEffects {
  struct Body {  // of the scene; several are one rigid body where they are welded
    std::string name;
    MovingPoint centre;
    double angle = 0.0;  // of its x axis against the rigid body's [rad]
  };
  struct Beam {
    std::string name;
    int first = -1;  // body of the first segment
    int segments = 0;
    double segment_length = 0.0;  // [m]
    // Into KirchhoffBeams, for a smooth one: `first` is its root body, taken as one segment.
    int smooth = -1;
    // Bodies of the stations where its start and end are welded; -1: not welded.
    std::array<int, 2> stations{-1, -1};
    std::vector<double> mass;  // by segment, with what its ends' bodies were given [kg]
    double EI = 0.0;           // of the section in the middle [N m^2]
    double EA = 0.0;           // likewise; 0: it does not stretch [N]
  };
  struct EndBody {  // that a beam's own end was given (sim/model/end_bodies.h)
    int body = -1;
    std::string name;  // BEAM.start or BEAM.end
  };
  struct Joint {
    std::string name;
    data::SceneJoint::Kind kind = data::SceneJoint::Kind::kRevolute;
    Coordinate coordinate;  // what springs and drives act on; its hinge gives theta
    MovingPoint pin;        // outer's point
    int latch = -1;         // into latches
    // By place in JointEffects, into that effect; -1: the joint has none.
    std::array<int, kJointEffects> effects = NoEffects();
    static constexpr std::array<int, kJointEffects> NoEffects() {
      std::array<int, kJointEffects> none{};
      none.fill(-1);
      return none;
    }
  };
  struct Function {  // of time, in a drive, motor or force
    data::TimeFunction function;
    int derivatives;  // that are needed
  };
  struct Mark {
    std::string name;
    MovingPoint point;
  };
  // An instrument; see data::SceneSensor.
  struct Sensor {
    std::string name;
    data::SceneSensor::Kind kind;
    MovingPoint point;
    double angle = 0.0;                // of its axis against the point's [rad]
    bool feels_gravity = true;         // of an accelerometer
    int beam = -1;                     // that it is on
    double place = 0.0, height = 0.0;  // along the beam, and off its centre line [m]
  };
  struct EffectCount {
    std::string name;
    int count;
  };

  std::string name;
  double duration = 0.0;  // [s]
  // For tolerances: the longest beam, or how far bodies reach or go [m]; a fifth of the scene's
  // duration, within which a deployment's velocities come and go [s].
  double length_scale = 0.0;
  double time_scale = 1.0;
  RigidBodies rigid_bodies;
  StateIndex index;

  Bending bending;
  KirchhoffBeams kirchhoff;
  Constraints constraints;

  std::vector<Body> bodies;
  std::vector<Beam> beams;
  std::vector<EndBody> end_bodies;
  std::vector<Joint> joints;
  std::vector<Mark> marks;
  std::vector<Sensor> sensors;
  double field[2] = {0.0, 0.0};  // gravity [m/s^2]
  std::vector<std::string> linear_spring_names;
  std::vector<Function> functions;
  Watches watches;

  std::vector<std::string> warnings;  // about the scene, one line each

  std::vector<double> initial_state;     // see StateIndex [SI]
  std::vector<LatchMode> initial_modes;  // by latch

  // What the scene called for: name of the effect and how many instances it holds.
  std::vector<EffectCount> Effects() const;
  // Names the functions of time that are not finite at t, or that change by more than their own
  // size within an instant, as they do before a pole; empty when all is well.
  std::string FaultyFunctions(double t) const;
  int FindMark(const std::string& mark) const;  // -1 when absent
  // Number of bodies that have a mass of their own (welded ones count once), segments included.
  int DynamicBodies() const;
};

// Throws Error (file:line:key, joints by name) for a scene that does not fit together: a loop that
// cannot close, redundant constraints, places given twice, welds that nothing can carry.
Model Compile(const data::Scene& scene);

}  // namespace unfurl::sim
