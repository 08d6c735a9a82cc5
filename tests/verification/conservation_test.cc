// Conservation laws. Source: mechanics. Quantity: energy where nothing is dissipated, linear
// momentum and the path of the centre of mass, angular momentum. Reference: their values at the
// start. Tolerance: energy to 1e-9 of its scale at rtol 1e-10, linear momentum to rounding, angular
// momentum to ten times the tolerance. Not checked: what is dissipated (deployment_test.cc).
#include <gtest/gtest.h>

#include <cmath>

#include "runs.h"

namespace unfurl::sim::conservation_test {
namespace {

// Two flexible beams on a spring hinge and a rigid body welded to the second, thrown through space
// with a spin.
constexpr char kThrown[] =
    "[scene]\nname = \"thrown\"\nduration = 2.0\n"
    "[beam.a]\nlength = 0.8\nmass = 0.424\nEI = 18.69\nsegments = 6\n"
    "pose = [0.0, 0.0, 0.3]\nvelocity = [2.0, 1.0, 3.0]\n"
    "[body.end_in]\nmass = 0.153\ninertia = 1.25e-4\n"
    "[body.end_out]\nmass = 0.153\ninertia = 1.25e-4\n"
    "[body.box]\nmass = 1.0\ninertia = 0.01\n"
    "[weld.w1]\ninner = \"a.end\"\nouter = \"end_in\"\nouter_point = [-0.01, 0.0]\n"
    "[joint.hinge]\ninner = \"end_in\"\ninner_point = [0.01, 0.0]\nouter = \"end_out\"\n"
    "outer_point = [-0.01, 0.0]\ntheta = 1.0\n"
    "[joint.hinge.spring]\nstiffness = 2.0\npreload = 0.5\n"
    "[weld.w2]\ninner = \"end_out\"\ninner_point = [0.01, 0.0]\nouter = \"b.start\"\n"
    "[beam.b]\nlength = 0.8\nmass = 0.424\nEI = 18.69\nsegments = 6\n"
    "[weld.w3]\ninner = \"b.end\"\nouter = \"box\"\nouter_point = [-0.05, 0.02]\n";

struct Departures {
  double energy = 0.0, momentum = 0.0, angular = 0.0, centre = 0.0;
};

Departures From(const Recorder& run) {
  const auto largest = [](const std::vector<double>& a) {
    double worst = 0.0;
    for (const double v : a) worst = std::max(worst, std::fabs(v));
    return worst;
  };
  const auto from_start = [&](const std::string& column) {
    std::vector<double> a = run[column];
    const double start = a[0];
    for (double& v : a) v -= start;
    return largest(a);
  };
  Departures d;
  d.energy = largest(run["energy.residual"]);
  d.momentum = std::max(from_start("momentum.x"), from_start("momentum.y"));
  d.angular = from_start("momentum.angular");
  std::vector<double> x = run["centre.x"], y = run["centre.y"];
  const std::vector<double> px = run["momentum.x"], py = run["momentum.y"];
  const double mass = 0.424 * 2 + 0.153 * 2 + 1.0, x0 = x[0], y0 = y[0];
  for (std::size_t k = 0; k < x.size(); ++k) {
    x[k] -= x0 + px[0] / mass * run.t[k];
    y[k] -= y0 + py[0] / mass * run.t[k];
  }
  d.centre = std::max(largest(x), largest(y));
  return d;
}

class Thrown : public ::testing::TestWithParam<std::string> {};

TEST_P(Thrown, KeepsEnergyAndMomentum) {
  data::Scene scene = data::ParseScene(kThrown, "thrown.toml");
  for (auto& beam : scene.beams) {
    if (GetParam() == "elastic") beam.axial_elastic = true, beam.EA = 1e5;
  }
  SimulateOptions options;
  options.rtol = 1e-10;
  options.rate = 100.0;
  const Recorder run = Record(Compile(scene), options);
  const Departures d = From(run);
  const double momentum = std::hypot(run["momentum.x"][0], run["momentum.y"][0]);
  const double angular = std::fabs(run["momentum.angular"][0]);
  ASSERT_GT(run.kinetic, 1.0);
  ASSERT_GT(momentum, 1.0);
  ASSERT_GT(angular, 1.0);
  const std::string name = "thrown beams, " + GetParam() + ", ";
  ExpectWithin(name + "energy", d.energy / run.kinetic, 1e-9);
  ExpectWithin(name + "linear momentum", d.momentum / momentum, 1e-13);
  // Errors of the steps, at the drift of a thrown body's arm: ten times the tolerance.
  ExpectWithin(name + "angular momentum", d.angular / angular, 1e-9);
  // 2 s of rounding in positions of some metres.
  ExpectWithin(name + "path of the centre [m]", d.centre, 1e-12);
}
INSTANTIATE_TEST_SUITE_P(Axial, Thrown, ::testing::Values("rigid", "elastic"));

}  // namespace
}  // namespace unfurl::sim::conservation_test
