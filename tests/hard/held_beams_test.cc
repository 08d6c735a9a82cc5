// Elastic beams held at one or both ends, from a ruler's size to a mast's, at rest under their
// weight or with a body that hangs on: small motions beside the length that tolerances refer to,
// while strains as large as a tolerance hold more energy than all that moves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "base/random.h"
#include "sim/methods/simulate.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::held_beams_test {
namespace {

constexpr double kDensity = 2700.0;  // [kg/m^3]

std::string DrawHeldBeam(std::uint64_t seed) {
  Rng rng(seed);
  const auto between = [&](double low, double high) { return low + (high - low) * rng.Uniform(); };
  const auto power = [&](double low, double high) { return std::pow(10.0, between(low, high)); };
  const double length = std::pow(10.0, std::floor(between(-1.0, 2.0)));
  const double side = length * power(-2.5, -1.5), area = side * side, E = power(9.0, 11.0);
  const double I = area * area / 12.0 * power(-1.0, 0.5), mass = kDensity * area * length;
  // Of the first bending mode between two pins.
  const double period =
      2.0 * M_PI * std::pow(length / M_PI, 2) * std::sqrt(mass / length / (E * I));
  const int kind = static_cast<int>(4.0 * rng.Uniform());
  const double g = kind == 3 ? 0.0 : (rng.Uniform() < 0.5 ? 1.0 : 9.81);
  const double damping = rng.Uniform() < 0.3 ? 1e-4 * period : 0.0;
  std::string t = fmt::format(
      "[scene]\nname = \"held {}\"\nduration = {:.6g}\n[gravity]\nacceleration = [0.0, -{}]\n"
      "[beam.b]\nlength = {}\nmass = {:.8g}\nE = {:.8g}\nI = {:.8g}\naxial = \"elastic\"\n"
      "EA = {:.8g}\nsegments = {}\ndamping = {:.4g}\n[mark.m]\non = \"b\"\nat = 0.5\n",
      seed, 8.0 * period, g, length, mass, E, I, E * area,
      4 + static_cast<int>(9.0 * rng.Uniform()), damping);
  const char* first = kind == 0 || kind == 3 ? "joint" : "weld";
  const auto hold = [&](const char* how, const char* name, const char* end, double x) {
    t += fmt::format("[{}.{}]\ninner = \"ground\"\ninner_point = [{}, 0.0]\nouter = \"b.{}\"\n",
                     how, name, x, end);
    if (how[0] == 'j') t += "theta = 0.0\n";
  };
  hold(first, "a", "start", 0.0);
  if (kind < 2) hold("joint", "c", "end", length);
  if (kind == 2) hold("weld", "c", "end", length);
  if (kind == 3) {
    t += fmt::format(
        "[body.d]\nmass = {:.6g}\ninertia = {:.6g}\n[joint.e]\ninner = \"b.end\"\nouter = \"d\"\n"
        "outer_point = [-{}, 0.0]\ntheta = 0.3\n",
        mass * between(0.1, 10.0), 0.1 * mass * length * length, 0.2 * length);
  }
  return t;
}

SimulateReport RunOf(const Model& model, Method method, double rtol) {
  SimulateOptions options;
  options.method = method;
  options.rtol = rtol;
  options.rate = 1.0;
  return Simulate(model, options, nullptr);
}

void ExpectUsableByAuto(const Model& model) {
  for (const double rtol : {1e-4, 1e-6}) {
    const SimulateReport report = RunOf(model, Method::kAuto, rtol);
    EXPECT_TRUE(report.Usable()) << rtol << ": " << report.message;
  }
}

// Before, one run of six was "not usable" by `auto` alone. UNFURL_HELD_BEAMS sets how many scenes.
TEST(HeldBeams, AutoIsUsableWhereImplicitIs) {
  const char* wanted = std::getenv("UNFURL_HELD_BEAMS");
  const int count =
      wanted != nullptr ? std::atoi(wanted) : 40;  // seed 36 had a step beyond the edge
  int usable = 0;
  for (int seed = 1; seed <= count; ++seed) {
    const std::string scene = DrawHeldBeam(static_cast<std::uint64_t>(seed));
    SCOPED_TRACE(scene);
    const Model model = ModelFrom(scene);
    for (const double rtol : {1e-4, 1e-5, 1e-6}) {
      const SimulateReport implicit = RunOf(model, Method::kImplicit, rtol);
      if (!implicit.Usable()) continue;
      ++usable;
      const SimulateReport run = RunOf(model, Method::kAuto, rtol);
      EXPECT_TRUE(run.Usable()) << rtol << ": " << run.message;
    }
  }
  EXPECT_GE(usable, 2 * count);  // else this says little
}

// Nothing acts on a smooth boom that hangs on its pin without gravity: what explicit steps leave at
// the edge of their stability is then all that moves, and less than the tolerance of its end bends.
TEST(HeldBeams, ABoomThatNothingActsOnIsGood) {
  const Model model = ModelFrom(
      "[scene]\nname = \"rest\"\nduration = 7.8\n"
      "[beam.b]\nlength = 5.7\nmass = 20.5\nEI = 5.5e4\nmodel = \"kirchhoff\"\norder = 3\n"
      "damping = 1.2e-4\n[body.tip]\nmass = 77.0\ninertia = 6.4\n"
      "[joint.p]\ninner = \"ground\"\nouter = \"b.start\"\ntheta = 2.3\n"
      "[weld.w]\ninner = \"b.end\"\nouter = \"tip\"\nouter_point = [-0.4, 0.0]\n");
  ExpectUsableByAuto(model);
}

// Segments that stretch are stiff beside a smooth beam, too.
TEST(HeldBeams, AStretchingBeamBesideASmoothOne) {
  const Model model = ModelFrom(
      "[scene]\nname = \"both\"\nduration = 0.5\n[gravity]\nacceleration = [0.0, -9.81]\n"
      "[beam.a]\nlength = 1.0\nmass = 0.5\nEI = 7.0\nmodel = \"kirchhoff\"\norder = 2\n"
      "[beam.b]\nlength = 1.0\nmass = 0.5\nEI = 7.0\nsegments = 8\naxial = \"elastic\"\nEA = 1e6\n"
      "[weld.w]\ninner = \"ground\"\nouter = \"a.start\"\n"
      "[weld.v]\ninner = \"a.end\"\nouter = \"b.start\"\n");
  ExpectUsableByAuto(model);
}

}  // namespace
}  // namespace unfurl::sim::held_beams_test
