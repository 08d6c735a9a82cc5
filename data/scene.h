#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace unfurl::data {

// A planar flexible mechanism as a person wrote it; every key with unit, default and equation is in
// docs/scene.md. Bodies are rigid; beams are chains of rigid segments joined by massless elastic
// elements; joints are revolute; welds are rigid. Numbers here are checked one by one; whether they
// fit together (names, loops, latches) is checked when the model is compiled.

// What an end of a joint or weld holds on to.
struct SceneEnd {
  enum class Kind { kGround, kBody, kBeamStart, kBeamEnd };
  Kind kind = Kind::kGround;
  int index = -1;                     // into Scene::bodies or Scene::beams; -1 for ground
  std::array<double, 2> point{0, 0};  // in the body's frame, or in the world for ground [m]
};

struct SceneBody {
  std::string name;
  double mass = 0.0;     // [kg]
  double inertia = 0.0;  // about the centre of mass [kg m^2]
  // Pose and velocity of the centre of mass at the start: only for a body whose place no joint or
  // weld gives (the root of its component).
  std::optional<std::array<double, 3>> pose;      // x, y [m], angle [rad]
  std::optional<std::array<double, 3>> velocity;  // [m/s], [m/s], [rad/s]
  std::string where;                              // file:line:key, for messages
};

// The beam's own x axis runs from its start (inboard) to its end (outboard).
struct SceneBeam {
  std::string name;
  double length = 0.0;  // [m]
  double mass = 0.0;    // [kg]
  double EI = 0.0;      // [N m^2]
  double EA = 0.0;      // [N]; needed only where axial_elastic
  int segments = 8;
  bool axial_elastic = false;
  double damping = 0.0;       // Kelvin-Voigt beta [s]
  bool gradient_form = true;  // element forces as the gradient of an energy; false: as printed
  std::optional<std::array<double, 3>> pose;      // of the start, as for a body
  std::optional<std::array<double, 3>> velocity;  // of the start
  std::string where;
};

struct SceneWeld {
  std::string name;
  SceneEnd inner, outer;
  double angle = 0.0;  // of outer's axis against inner's [rad]
  std::string where;
};

// Moment on theta: -stiffness (theta + preload).
struct SceneSpring {
  double stiffness = 0.0;  // [N m/rad]
  double preload = 0.0;    // [rad]
  std::string where;
};

// The contact law of a latch, [paper, eq. (14) to (23)].
struct SceneContact {
  std::string name;
  double K = 0.0;           // Hertz stiffness, eq. (15) [N/m^1.5]
  double C = 0.0;           // damping, eq. (19) [N s/m]
  double Q = 0.0;           // shape in the transition zone, eq. (18) [-]
  double epsilon = 0.0;     // depth of the transition zone, eq. (18) [m]
  bool never_pulls = true;  // f = max(f, 0); false: eq. (22) as printed
  std::string where;
};

struct SceneLatch {
  double theta_a = 0.0;  // upper stop once latched; it latches as theta falls through [rad]
  double theta_b = 0.0;  // the lower stop is at -theta_b [rad]
  double lever = 0.0;    // x_p, from the pivot to the contact, eq. (20) [m]
  int contact = -1;      // into Scene::contacts
  std::string where;
};

// Revolute: the two points coincide, and
//   angle(outer) - angle(inner) = zero_angle + sign * theta.
struct SceneJoint {
  std::string name;
  SceneEnd inner, outer;
  double sign = 1.0;        // +1 or -1
  double zero_angle = 0.0;  // [rad]
  double theta = 0.0;       // at the start [rad]
  double theta_rate = 0.0;  // at the start [rad/s]
  double hang_theta = 0.0;  // where the suspension's strings hang vertically [rad]
  std::optional<SceneSpring> spring;
  std::optional<SceneLatch> latch;
  std::string where;
};

struct SceneMark {
  std::string name;
  SceneEnd on;
  std::string where;
};

struct SceneGravity {
  std::array<double, 2> acceleration{0, 0};  // [m/s^2]
};

// Long vertical strings on every centre of mass: force -(m g / length) (r - r_hang) in the plane.
struct SceneSuspension {
  double length = 0.0;    // [m]
  double gravity = 9.81;  // [m/s^2]
};

struct Scene {
  std::string name;
  std::string path;       // the file it came from
  double duration = 0.0;  // [s]
  std::vector<SceneBody> bodies;
  std::vector<SceneBeam> beams;
  std::vector<SceneWeld> welds;
  std::vector<SceneJoint> joints;
  std::vector<SceneContact> contacts;
  std::vector<SceneMark> marks;
  std::optional<SceneGravity> gravity;
  std::optional<SceneSuspension> suspension;
};

// `overrides`: "dotted.key=value", see LoadToml. Throws Error (file:line:key) for anything that is
// missing, unknown, out of range or not finite.
Scene ReadScene(const std::string& path, const std::vector<std::string>& overrides = {});
Scene ParseScene(const std::string& text, const std::string& name);

// K of eq. (15) with (16). A radius of infinity stands for a plane.
double HertzStiffness(double radius_i, double radius_j, double modulus_i, double poisson_i,
                      double modulus_j, double poisson_j);
// C of eq. (19): M [kg], k [N/m], restitution e in (0, 1].
double ContactDamping(double mass, double stiffness, double restitution);

}  // namespace unfurl::data
