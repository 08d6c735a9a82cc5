// Equilibria far from where a scene is drawn, of segments of any number against smooth beams, whose
// shapes and equations are others.
#include "sim/implicit/equilibrium.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/dynamics/observables.h"
#include "sim/implicit/modes.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::equilibrium_test {
namespace {

struct Rest {
  double frequency;  // [Hz], of the lowest mode
  double x, y;       // of the end [m]
};

Rest RestOf(const std::string& scene) {
  const Model model = ModelFrom(scene);
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state;
  const EquilibriumReport report = FindEquilibrium(&dynamics, y.data());
  EXPECT_TRUE(report.found) << report.iterations << " " << report.acceleration;
  const PointMotion end = MotionOf(model, model.marks[0].point, y.data());
  return {FindModes(&dynamics, y.data(), 1, ModesSolver::kAuto).modes.at(0).frequency, end.x,
          end.y};
}

constexpr int kFinest = 96;  // segments: moves upset what is stiff the more the shorter these are

void AreThoseOfSmoothBeams(const std::string& scene, double error) {
  const Rest smooth = RestOf(fmt::format(fmt::runtime(scene), "model = 'kirchhoff'\norder = 8\n"));
  for (const int segments : {6, 24, kFinest}) {
    const Rest found =
        RestOf(fmt::format(fmt::runtime(scene), fmt::format("segments = {}\n", segments)));
    const double square = segments * segments;
    EXPECT_NEAR(found.x, smooth.x, error / square) << segments;
    EXPECT_NEAR(found.y, smooth.y, error / square) << segments;
    EXPECT_NEAR(found.frequency / smooth.frequency, 1.0, error / square) << segments;
  }
}

// A rod drawn 30 degrees above the horizontal hangs nearly straight down from its clamp: m g L^3 /
// EI is 98.
TEST(EquilibriumFar, ARodThatHangsDownFromItsClamp) {
  AreThoseOfSmoothBeams(
      "[scene]\nname = 'rod'\nduration = 1.0\n[gravity]\nacceleration = [0, -9.81]\n"
      "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 0.1\n{0}"
      "[weld.root]\ninner = 'ground'\nouter = 'rod.start'\nangle = 0.5\n"
      "[mark.end]\non = 'rod.end'\n",
      6.0);
}

// A hub on a pin, two rods with a spring between and a body at the end, all of which turn by more
// than a radian.
TEST(EquilibriumFar, AHubAndTwoRods) {
  AreThoseOfSmoothBeams(
      "[scene]\nname = 'hub'\nduration = 1.0\n[gravity]\nacceleration = [0, -9.81]\n"
      "[body.hub]\nmass = 2.0\ninertia = 0.1\n"
      "[joint.root]\ninner = 'ground'\nouter = 'hub'\nouter_point = [-0.2, 0.1]\ntheta = 0.8\n"
      "[joint.root.spring]\nstiffness = 3.0\n"
      "[beam.one]\nlength = 1.0\nmass = 0.3\nEI = 1.0\n{0}"
      "[weld.one]\ninner = 'hub'\nouter = 'one.start'\ninner_point = [0.2, 0]\nangle = 0.4\n"
      "[beam.two]\nlength = 0.8\nmass = 0.3\nEI = 0.7\n{0}"
      "[joint.knee]\ninner = 'one.end'\nouter = 'two.start'\ntheta = 1.2\n"
      "[joint.knee.spring]\nstiffness = 0.8\nfree = -0.5\n"
      "[body.tip]\nmass = 0.1\ninertia = 0.001\n"
      "[weld.tip]\ninner = 'two.end'\nouter = 'tip'\n"
      "[mark.end]\non = 'tip'\n",
      6.0);
}

}  // namespace
}  // namespace unfurl::sim::equilibrium_test
