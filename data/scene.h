#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "data/beam_section.h"
#include "data/time_function.h"

namespace unfurl::data {

class TomlTable;

// A planar flexible mechanism as a person wrote it; every key with unit, default and equation is in
// docs/scene.md. Bodies are rigid; beams are flexible, by one of two models; joints are revolute,
// sliders or pins in slots; welds are rigid. Numbers here are checked one by one; whether they
// fit together (names, loops, latches) is checked when the model is compiled.

// What an end of a joint or weld holds on to.
struct SceneEnd {
  // Which kind of carrier.
  enum class Kind { kGround, kBody, kBeamStart, kBeamEnd, kAlongBeam };
  Kind kind = Kind::kGround;
  int index = -1;                     // into Scene::bodies or Scene::beams; -1 for ground
  std::array<double, 2> point{0, 0};  // in the body's frame, or in the world for ground [m]
  double at = 0.0;                    // kAlongBeam: place on the axis, of the length, in [0, 1]
};

// A rigid body.
struct SceneBody {
  std::string name;
  double mass = 0.0;     // [kg]
  double inertia = 0.0;  // about the centre of mass [kg m^2]
  // Pose and velocity of the centre of mass at the start: only for a body whose place no joint or
  // weld gives (the root of its component).
  std::optional<std::array<double, 3>> pose;      // x, y [m], angle [rad]
  std::optional<std::array<double, 3>> velocity;  // [m/s], [m/s], [rad/s]
  bool implied = false;                           // not written by the person; not in the results
  std::string where;                              // file:line:key, for messages
};

// How a beam deforms: a chain of rigid segments joined by massless elastic elements (the paper's),
// or one smooth centre line.
enum class BeamModel { kSegments, kKirchhoff };

inline constexpr int kMostSegments = 1'000'000;  // of a beam; a state of some 50 MB
inline constexpr int kHighestOrder = 11;         // modes of one smooth beam

// The beam's own x axis runs from its start (inboard) to its end (outboard).
struct SceneBeam {
  std::string name;
  double length = 0.0;  // [m]
  double mass = 0.0;    // [kg]
  double EI = 0.0;      // of the section at the start [N m^2]
  double EA = 0.0;      // likewise [N]; needed only where axial_elastic
  BeamSection section;  // along the beam
  BeamModel model = BeamModel::kSegments;
  int segments = 8;  // kSegments
  int order = 3;     // kKirchhoff: modes of the free beam among its shapes, 1 to 11
  bool axial_elastic = false;
  double damping = 0.0;       // Kelvin-Voigt beta [s]
  bool gradient_form = true;  // element forces as the gradient of an energy; false: as printed
  // The longitudinal constraint along the line between the stations; false: along the inboard
  // segment's axis, as printed.
  bool along_chord = true;
  std::array<bool, 2> carried_ends{false, false};  // an implied body holds part of the end's mass
  std::optional<std::array<double, 3>> pose;  // of the start, as for a body: x, y [m], angle [rad]
  std::optional<std::array<double, 3>> velocity;  // of the start [m/s], [m/s], [rad/s]
  std::string where;
};

// Joins two ends rigidly.
struct SceneWeld {
  std::string name;
  SceneEnd inner, outer;
  double angle = 0.0;  // of outer's axis against inner's [rad]
  std::string where;
};

// What acts on a joint's coordinate: theta of a revolute joint, the travel of a slider or of a pin
// in a slot. Units are given for the angle; for the travel read N for N m and m for rad.

// Moment -stiffness (coordinate + preload).
struct SceneSpring {
  static constexpr const char* kKey = "spring";
  double stiffness = 0.0;  // [N m/rad]
  double preload = 0.0;    // [rad]
  std::string where;
};

// Moment -damping d(coordinate)/dt.
struct SceneDamper {
  static constexpr const char* kKey = "damper";
  double damping = 0.0;  // [N m s/rad]
  std::string where;
};

// Moment -damping |d(coordinate)/dt| d(coordinate)/dt: drag of a fluid at speed, an orifice.
struct SceneQuadraticDamper {
  static constexpr const char* kKey = "quadratic_damper";
  double damping = 0.0;  // [N m s^2/rad^2]
  std::string where;
};

// Moment as a function of the coordinate (a tape spring): monotone cubic through the points
// (Fritsch and Butland), straight beyond the ends.
struct SceneMomentTable {
  static constexpr const char* kKey = "table";
  std::vector<double> coordinate;  // rising [rad]
  std::vector<double> moment;      // on the coordinate [N m]
  std::string where;
};

// Dry friction, moment -moment tanh(rate / creep_rate).
struct SceneFriction {
  static constexpr const char* kKey = "friction";
  double moment = 0.0;      // [N m]
  double creep_rate = 0.0;  // where the moment has reached 76% [rad/s]
  std::string where;
};

// The coordinate is prescribed: by itself, or by its rate from its value at the start.
struct SceneDrive {
  bool by_rate = false;
  TimeFunction function;  // [rad], [rad/s]
  std::string where;
};

// A moment on the coordinate as a function of time.
struct SceneMotor {
  static constexpr const char* kKey = "motor";
  TimeFunction moment;  // [N m]
  std::string where;
};

// The moments (or forces) on one joint's coordinate. To add one: its record here, with the key of
// its table, the reader's Read() for it, and its law in sim/effects/joint_effects.h. Whatever is
// left out does not compile (docs/extending.md).
struct SceneJointEffects {
  std::optional<SceneSpring> spring;
  std::optional<SceneDamper> damper;
  std::optional<SceneMomentTable> table;
  std::optional<SceneFriction> friction;
  std::optional<SceneMotor> motor;
  std::optional<SceneQuadraticDamper> quadratic_damper;
};

namespace internal {
template <typename Effects, typename Visit>
void VisitJointEffects(Effects& effects, Visit&& visit) {
  // All of them, or the compiler objects.
  auto& [spring, damper, table, friction, motor, quadratic_damper] = effects;
  const auto each = [&](auto&... effect) { (visit(effect), ...); };
  each(spring, damper, table, friction, motor, quadratic_damper);
}
}  // namespace internal

// Calls visit(std::optional<Record>&) for every member.
template <typename Visit>
void VisitJointEffects(const SceneJointEffects& effects, Visit&& visit) {
  internal::VisitJointEffects(effects, visit);
}
template <typename Visit>
void VisitJointEffects(SceneJointEffects& effects, Visit&& visit) {
  internal::VisitJointEffects(effects, visit);
}

// The contact law of a latch: Hertz's spring and one of two dampers (sim/effects/contact_law.h).
struct SceneContact {
  /// How force follows depth and speed.
  enum class Law {
    kRamped,        // f = K delta^1.5 + C T(delta) d(delta)/dt, [paper, eq. (14) to (23)]
    kHuntCrossley,  // f = K delta^1.5 (1 + 1.5 alpha d(delta)/dt), [Hunt and Crossley 1975]
  };
  std::string name;
  Law law = Law::kRamped;
  double K = 0.0;           // Hertz stiffness, eq. (15) [N/m^1.5]
  double C = 0.0;           // damping, eq. (19) [N s/m]
  double Q = 0.0;           // shape in the transition zone, eq. (18) [-]
  double epsilon = 0.0;     // depth of the transition zone, eq. (18) [m]
  double alpha = 0.0;       // kHuntCrossley: restitution lost per speed of a slow impact [s/m]
  bool never_pulls = true;  // f = max(f, 0); false: eq. (22) as printed
  std::string where;
};

// A latch: two stops with clearance, active once theta has fallen through theta_a.
struct SceneLatch {
  double theta_a = 0.0;  // upper stop once latched; it latches as theta falls through [rad]
  double theta_b = 0.0;  // the lower stop is at -theta_b [rad]
  double lever = 0.0;    // x_p, from the pivot to the contact, eq. (20) [m]
  int contact = -1;      // into Scene::contacts
  std::string where;
};

// kRevolute: the two points coincide, and
//   angle(outer) - angle(inner) = zero_angle + sign * theta.
// kSlider: outer's point lies at `sign * travel` on the line through inner's along `axis`, and
//   angle(outer) - angle(inner) = zero_angle.
// kPinInSlot: like a slider, but outer turns freely: theta as for a revolute joint.
struct SceneJoint : SceneJointEffects {
  // The kind of joint, as above.
  enum class Kind { kRevolute, kSlider, kPinInSlot };
  std::string name;
  Kind kind = Kind::kRevolute;
  SceneEnd inner, outer;
  double sign = 1.0;         // +1 or -1 [-]
  double zero_angle = 0.0;   // [rad]
  double axis = 0.0;         // of the slot, in inner's frame [rad]
  double theta = 0.0;        // at the start [rad]
  double theta_rate = 0.0;   // at the start [rad/s]
  double travel = 0.0;       // at the start [m]
  double travel_rate = 0.0;  // at the start [m/s]
  double hang_theta = 0.0;   // where the suspension's strings hang vertically [rad]
  double hang_travel = 0.0;  // likewise [m]
  std::optional<SceneDrive> drive;
  std::optional<SceneLatch> latch;  // revolute only
  std::string where;
};

// A spring and damper between two points: tension stiffness (distance - free_length) + damping
// d(distance)/dt.
struct SceneLinearSpring {
  std::string name;
  SceneEnd a, b;
  double stiffness = 0.0;             // [N/m]
  double damping = 0.0;               // [N s/m]
  std::optional<double> free_length;  // none: the distance at the start [m]
  std::string where;
};

// A force at a point, a torque, or a force per length all along a beam.
struct SceneForce {
  // What acts.
  enum class Kind { kForce, kTorque, kPerLength };
  std::string name;
  Kind kind = Kind::kForce;
  SceneEnd on;                        // kPerLength: index of the beam
  std::array<TimeFunction, 2> force;  // [N]; kPerLength: [N/m]
  TimeFunction torque;                // [N m]
  bool follows = false;               // components in the frame of the body or beam
  std::string where;
};

// Something to be located in time: `quantity` (JOINT.theta, JOINT.theta_rate, JOINT.travel, BODY.x,
// BODY.theta, MARK.x, ...) crosses `level`.
struct SceneWatch {
  // Which way the level is crossed.
  enum class Direction { kRising, kFalling, kBoth };
  std::string name;
  std::string quantity;
  double level = 0.0;  // [the quantity's unit]
  Direction direction = Direction::kBoth;
  bool stop = false;  // the run ends there
  std::string where;
};

// What the command line may override; absent: its defaults.
struct SceneSolver {
  std::optional<std::string> method;  // "auto", "projected", "partitioned", "implicit"
  std::optional<double> rtol;         // [-]
  std::optional<double> rate;         // samples per second [1/s]
};

// A light mark.
struct SceneMark {
  std::string name;
  SceneEnd on;
  std::string where;
};

// An instrument that the structure carries.
struct SceneSensor {
  // What it reads.
  enum class Kind { kAccelerometer, kGyroscope, kCurvature, kStrainGauge };
  std::string name;
  Kind kind = Kind::kAccelerometer;
  SceneEnd on;                // of curvature and strain: kAlongBeam, or a beam's end
  double axis = 0.0;          // of an accelerometer, against its body's x axis [rad]
  bool feels_gravity = true;  // of an accelerometer: it reads the specific force
  double height = 0.0;        // of a strain gauge: to the left of the centre line [m]
  std::string where;
};

// Uniform gravity in the plane.
struct SceneGravity {
  std::array<double, 2> acceleration{0, 0};  // [m/s^2]
};

// Long vertical strings on every centre of mass: force -(m g / length) (r - r_hang) in the plane.
struct SceneSuspension {
  double length = 0.0;    // [m]
  double gravity = 9.81;  // [m/s^2]
};

// A mechanism as read: every part by name, in the file's order.
struct Scene {
  std::string name;
  std::string path;                // the file it came from
  std::vector<std::string> files;  // that file and those that it includes
  double duration = 0.0;           // [s]
  std::vector<SceneBody> bodies;
  std::vector<SceneBeam> beams;
  std::vector<SceneWeld> welds;
  std::vector<SceneJoint> joints;
  std::vector<SceneContact> contacts;
  std::vector<SceneLinearSpring> linear_springs;
  std::vector<SceneForce> forces;
  std::vector<SceneWatch> watches;
  std::vector<SceneMark> marks;
  std::vector<SceneSensor> sensors;
  std::optional<SceneGravity> gravity;
  std::optional<SceneSuspension> suspension;
  SceneSolver solver;
};

// `overrides`: "dotted.key=value", see LoadToml. Throws Error (file:line:key) for anything that is
// missing, unknown, out of range or not finite.
Scene ReadScene(const std::string& path, const std::vector<std::string>& overrides = {});
Scene ReadScene(const TomlTable& root, const std::string& name);
Scene ParseScene(const std::string& text, const std::string& name);

// K of eq. (15) with (16). A radius of infinity stands for a plane.
double HertzStiffness(double radius_i, double radius_j, double modulus_i, double poisson_i,
                      double modulus_j, double poisson_j);
// C of eq. (19): M [kg], k [N/m], restitution e in (0, 1].
double ContactDamping(double mass, double stiffness, double restitution);

}  // namespace unfurl::data
