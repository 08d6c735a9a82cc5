#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "base/random.h"

namespace unfurl::sim {

// A mechanism drawn by its seed: one to three beams in a chain, from the ground or from a free hub;
// segments or smooth beams; springs, dampers of the joints and of the material, latches, gravity;
// masses, stiffnesses and rates over an order of magnitude or two.
struct RandomScene {
  std::string toml;
  bool latches = false, smooth = false, damped = false;
};

inline RandomScene DrawScene(std::uint64_t seed) {
  Rng rng(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * rng.Uniform(); };
  const auto power = [&](double low, double high) { return std::pow(10.0, between(low, high)); };
  const auto chance = [&](double p) { return rng.Uniform() < p; };
  RandomScene out;
  const int beams = 1 + static_cast<int>(3.0 * rng.Uniform());
  const bool free = chance(0.33), gravity = !free && chance(0.4), may_latch = chance(0.5);
  out.smooth = chance(0.4);
  out.damped = chance(0.6);
  const double beta = out.damped ? power(-5.5, -3.0) : 0.0;
  std::string& t = out.toml;
  t = fmt::format("[scene]\nname = \"random {}\"\nduration = {:.3f}\n", seed, between(0.2, 0.4));
  t += "[contact.lock]\nK = 5e8\nC = 4000.0\nQ = 3.0\nepsilon = 5e-6\n";
  if (free) {
    t += fmt::format("[body.hub]\nmass = {:.3f}\ninertia = {:.4f}\n", between(1.0, 20.0),
                     between(0.1, 2.0));
  }
  for (int b = 0; b < beams; ++b) {
    t += fmt::format("[beam.b{}]\nlength = {:.3f}\nmass = {:.3f}\nEI = {:.3f}\ndamping = {:.3g}\n",
                     b, between(0.4, 1.2), between(0.2, 0.8), power(0.7, 2.3), beta);
    const int fineness = static_cast<int>(3.0 * rng.Uniform());
    t += out.smooth ? fmt::format("model = \"kirchhoff\"\norder = {}\n", 1 + fineness)
                    : fmt::format("segments = {}\n", 4 + fineness);
    const std::string inner = b > 0 ? fmt::format("b{}.end", b - 1) : free ? "hub" : "ground";
    t += fmt::format(
        "[joint.j{0}]\ninner = \"{1}\"\nouter = \"b{0}.start\"\ntheta = {2:.4f}\nsign = {3}\n"
        "theta_rate = {4:.3f}\n[joint.j{0}.spring]\nstiffness = {5:.3f}\npreload = {6:.3f}\n",
        b, inner, between(0.3, 2.8), chance(0.5) ? 1 : -1, -between(0.0, 2.0), power(-0.7, 0.7),
        between(0.2, 1.5));
    if (chance(0.4)) t += fmt::format("[joint.j{}.damper]\ndamping = {:.4g}\n", b, power(-3, 0.5));
    if (may_latch && chance(0.7)) {
      out.latches = true;
      const double clearance = between(0.001, 0.006);
      t += fmt::format(
          "[joint.j{0}.latch]\ntheta_a = {1:.4f}\ntheta_b = {1:.4f}\nlever = 0.03\n"
          "contact = \"lock\"\n",
          b, clearance);
    }
    t += fmt::format("[mark.m{0}]\non = \"b{0}.end\"\n", b);
  }
  if (gravity) t += "[gravity]\nacceleration = [0.0, -9.81]\n";
  return out;
}

// A mechanism of stretching beams with EA from 1e4 to 1e8 N, log-uniform: a boom on a free hub, a
// pendulum, two links that latch, a free beam under a force, two links with a damper.
inline RandomScene DrawStiffScene(std::uint64_t seed) {
  Rng rng(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * rng.Uniform(); };
  const auto power = [&](double low, double high) { return std::pow(10.0, between(low, high)); };
  const double EA = power(4.0, 8.0);
  const int kind = static_cast<int>(5.0 * rng.Uniform());
  const double beta = rng.Uniform() < 0.5 ? power(-7.0, -5.0) : 0.0;
  RandomScene out;
  out.damped = beta > 0.0;
  out.latches = kind == 2;
  std::string& t = out.toml;
  t = fmt::format("[scene]\nname = \"stiff {}\"\nduration = {:.3f}\n", seed, between(0.2, 0.4));
  t += "[contact.lock]\nK = 5e8\nC = 4000.0\nQ = 3.0\nepsilon = 5e-6\n";
  const auto beam = [&](const char* name) {
    t += fmt::format(
        "[beam.{}]\nlength = {:.3f}\nmass = {:.3f}\nEI = {:.3f}\nsegments = {}\n"
        "axial = \"elastic\"\nEA = {:.4g}\ndamping = {:.3g}\n[mark.{}]\non = \"{}.end\"\n",
        name, between(0.5, 1.2), between(0.2, 0.8), power(0.7, 2.5),
        3 + static_cast<int>(4.0 * rng.Uniform()), EA, beta, std::string("m") + name, name);
  };
  const auto joint = [&](const char* name, const char* inner, const char* outer) {
    t += fmt::format(
        "[joint.{0}]\ninner = \"{1}\"\nouter = \"{2}.start\"\ntheta = {3:.3f}\n"
        "theta_rate = {4:.3f}\n[joint.{0}.spring]\nstiffness = {5:.3f}\npreload = 0.7\n",
        name, inner, outer, between(0.2, 1.4), -between(0.0, 2.0), power(-1.0, 1.0));
  };
  beam("a");
  if (kind == 0) {
    t += fmt::format("[body.hub]\nmass = {:.2f}\ninertia = {:.3f}\nvelocity = [0, 0, {:.2f}]\n",
                     between(1.0, 5.0), power(-1.5, 0.0), between(-3.0, 3.0));
    t += "[weld.w]\ninner = \"hub\"\nouter = \"a.start\"\n";
  } else if (kind == 3) {
    t += fmt::format("[force.f]\non = \"a.end\"\nforce = [{:.2f}, {:.2f}]\n", between(-2.0, 2.0),
                     between(-2.0, 2.0));
  } else {
    joint("p", "ground", "a");
    if (kind != 2) t += "[gravity]\nacceleration = [0.0, -9.81]\n";
  }
  if (kind == 2 || kind == 4) {
    beam("b");
    joint("q", "a.end", "b");
    t += kind == 2 ? "[joint.q.latch]\ntheta_a = 0.003\ntheta_b = 0.003\nlever = 0.03\n"
                     "contact = \"lock\"\n"
                   : fmt::format("[joint.q.damper]\ndamping = {:.4f}\n", power(-3.0, 0.0));
  }
  return out;
}

// A loop of three beams between two points of the ground, driven by its crank's spring; gravity,
// dampers, a latch of the crank.
inline RandomScene DrawLoopScene(std::uint64_t seed) {
  Rng rng(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * rng.Uniform(); };
  const auto power = [&](double low, double high) { return std::pow(10.0, between(low, high)); };
  const auto chance = [&](double p) { return rng.Uniform() < p; };
  const double ground = between(1.0, 1.4), crank = between(0.3, 0.5), rocker = between(0.4, 0.7);
  const double at_crank = between(0.6, 2.0), at_rocker = between(0.7, 1.6);
  const double x = ground + rocker * std::cos(at_rocker) - crank * std::cos(at_crank);
  const double y = rocker * std::sin(at_rocker) - crank * std::sin(at_crank);
  const double coupler = std::hypot(x, y), at_coupler = std::atan2(y, x);
  RandomScene out;
  out.smooth = chance(0.4);
  out.damped = chance(0.6);
  out.latches = chance(0.3);
  const double beta = out.damped ? power(-5.0, -3.0) : 0.0;
  const bool gravity = chance(0.4), damper = chance(0.4);
  std::string& t = out.toml;
  t = fmt::format("[scene]\nname = \"loop {}\"\nduration = {:.3f}\n", seed, between(0.2, 0.4));
  t += "[contact.lock]\nK = 5e8\nC = 4000.0\nQ = 3.0\nepsilon = 5e-6\n";
  const auto beam = [&](const char* name, double length) {
    const int fineness = static_cast<int>(3.0 * rng.Uniform());
    t += fmt::format(
        "[beam.{0}]\nlength = {1:.17g}\nmass = {2:.3f}\nEI = {3:.3f}\ndamping = {4:.3g}\n{5} = "
        "{6}\n[mark.m{0}]\non = \"{0}.{7}\"\n",
        name, length, between(0.2, 0.8), power(0.5, 2.0), beta,
        out.smooth ? "model = \"kirchhoff\"\norder" : "segments", (out.smooth ? 1 : 4) + fineness,
        length == rocker ? "start" : "end");  // its end is a pin on the ground
  };
  beam("crank", crank);
  beam("coupler", coupler);
  beam("rocker", rocker);
  const double swing = between(0.2, 0.5);  // of the crank, to where its spring is at rest [rad]
  t += fmt::format(
      "[joint.p]\ninner = \"ground\"\nouter = \"crank.start\"\nzero_angle = {:.17g}\n"
      "theta = {:.17g}\n[joint.p.spring]\nstiffness = {:.3f}\npreload = {:.3f}\n",
      at_crank - swing, swing, power(0.0, 1.3), between(0.2, 1.0));
  if (damper) t += fmt::format("[joint.p.damper]\ndamping = {:.4g}\n", power(-3.0, 0.0));
  if (out.latches) {
    t += fmt::format(
        "[joint.p.latch]\ntheta_a = {0:.4f}\ntheta_b = {0:.4f}\nlever = 0.03\n"
        "contact = \"lock\"\n",
        between(0.001, 0.006));
  }
  t += fmt::format(
      "[joint.q]\ninner = \"crank.end\"\nouter = \"coupler.start\"\ntheta = {:.17g}\n"
      "[joint.r]\ninner = \"coupler.end\"\nouter = \"rocker.start\"\ntheta = {:.17g}\n"
      "[joint.s]\ninner = \"ground\"\ninner_point = [{:.17g}, 0.0]\nouter = \"rocker.end\"\n"
      "theta = {:.17g}\n",
      at_coupler - at_crank, at_rocker - M_PI - at_coupler, ground, at_rocker - M_PI);
  if (gravity) t += "[gravity]\nacceleration = [0.0, -9.81]\n";
  return out;
}

}  // namespace unfurl::sim
