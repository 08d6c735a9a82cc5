#pragma once

#include <fmt/format.h>

#include <string>

#include "data/scene.h"
#include "sim/model/model.h"
#include "tests/source_dir.h"

namespace unfurl::sim {

// Small scenes that several tests share.

inline constexpr char kContact[] =
    "[contact.lock]\n"
    "K = 5e9\nC = 4000.0\nQ = 3.0\nepsilon = 5e-6\n";

// A rigid bar on a pin at the origin, its centre `r` away; gravity along -y.
inline std::string PendulumScene(double theta, double r = 0.5, double inertia = 0.1) {
  return fmt::format(
      "[scene]\nname = \"pendulum\"\nduration = 5.0\n"
      "[body.bar]\nmass = 2.0\ninertia = {}\n"
      "[joint.pivot]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [{}, 0.0]\n"
      "zero_angle = -1.5707963267948966\ntheta = {}\n"
      "[gravity]\nacceleration = [0.0, -9.81]\n"
      "[mark.tip]\non = \"bar\"\npoint = [{}, 0.0]\n",
      inertia, -r, theta, r);
}

// A bar on a latching joint that a torsion spring swings in, no gravity.
inline std::string LatchingBarScene(double theta_a = 0.0052, const std::string& more = {}) {
  return fmt::format(
      "[scene]\nname = \"latching bar\"\nduration = 2.0\n{}"
      "[body.bar]\nmass = 0.5\ninertia = 0.02\n"
      "[joint.hinge]\ninner = \"ground\"\nouter = \"bar\"\nouter_point = [-0.3, 0.0]\n"
      "theta = 1.5707963267948966\n"
      "[joint.hinge.spring]\nstiffness = 0.218\npreload = 1.57\n"
      "[joint.hinge.latch]\ntheta_a = {}\ntheta_b = {}\nlever = 0.02\ncontact = \"lock\"\n"
      "{}"
      "[mark.tip]\non = \"bar\"\npoint = [0.3, 0.0]\n",
      kContact, theta_a, theta_a, more);
}

// A straight uniform beam along x from the origin, "clamped" to the ground at its start or "free".
inline std::string BeamScene(const std::string& start, int segments, const std::string& more = {}) {
  std::string text =
      "[scene]\nname = \"beam\"\nduration = 1.0\n" +
      fmt::format("[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = {}\n{}", segments,
                  more);
  if (start == "clamped") text += "[weld.root]\ninner = \"ground\"\nouter = \"rod.start\"\n";
  text += "[mark.tip]\non = \"rod.end\"\n";
  return text;
}

inline Model ModelFrom(const std::string& toml) {
  return Compile(data::ParseScene(toml, "test.toml"));
}

inline std::string DeploymentPath(const std::string& variant) {
  return std::string(UNFURL_SOURCE_DIR) + "/data/sets/deployment/scene_" + variant + ".toml";
}

}  // namespace unfurl::sim
