// Hard cases of meshes and sizes, graded by size.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "data/scene.h"
#include "sim/dynamics/dynamics.h"
#include "sim/methods/simulate.h"
#include "tests/source_dir.h"

namespace unfurl::sim::mesh_hard_test {
namespace {

// Grade 1: one segment a beam. Rule: the deployment ends with its four latches.
TEST(MeshHard, DeploymentOfOneSegmentABeam) {
  data::Scene scene = data::ReadScene(std::string(UNFURL_SOURCE_DIR) +
                                      "/data/sets/deployment/scene_clearance.toml");
  for (auto& beam : scene.beams) beam.segments = 1;
  const SimulateReport report = Simulate(Compile(scene), {}, nullptr);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_EQ(report.Count(EventKind::kLatch), 4);
}

// Grade 2: meshes that differ a hundredfold in one scene. Rule: the run ends and the joint holds.
TEST(MeshHard, FineBesideCoarse) {
  const Model model =
      Compile(data::ParseScene("[scene]\nname = \"unlike\"\nduration = 0.02\n"
                               "[beam.a]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 1\n"
                               "[beam.b]\nlength = 1.0\nmass = 1.0\nEI = 10.0\nsegments = 100\n"
                               "[joint.one]\ninner = \"ground\"\nouter = \"a.start\"\n"
                               "[joint.two]\ninner = \"a.end\"\nouter = \"b.start\"\n"
                               "[gravity]\nacceleration = [0.0, -9.81]\n",
                               "unlike.toml"));
  const SimulateReport report = Simulate(model, {}, nullptr);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_LT(report.largest_position_drift, 1e-6);
}

// Grade 3: a hundred thousand segments. Rule: the model is there within seconds and its right side
// falls freely: every acceleration is gravity's.
TEST(MeshHard, HundredThousandSegmentsFallFreely) {
  const auto begin = std::chrono::steady_clock::now();
  const Model model = Compile(
      data::ParseScene("[scene]\nname = \"long\"\nduration = 1.0\n"
                       "[beam.rod]\nlength = 1000.0\nmass = 1000.0\nEI = 10.0\nsegments = 100000\n"
                       "[gravity]\nacceleration = [0.0, -9.81]\n",
                       "long.toml"));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(took.count(), 10.0);  // a second is asked of a quiet machine; this one is shared
  Dynamics dynamics(model);
  std::vector<double> y = model.initial_state, rate(y.size());
  dynamics.RightSide(0.0, y.data(), rate.data());
  double worst = 0.0;
  for (int s = 0; s < model.rigid_bodies.count; ++s) {
    if (!model.rigid_bodies.IsDynamic(s)) continue;
    worst = std::max(worst, std::fabs(rate[model.index.vy(s)] + 9.81));
    worst = std::max(worst, std::fabs(rate[model.index.vx(s)]));
  }
  EXPECT_LT(worst, 1e-6);  // rounding of forces that grow as EI / l^3
}

}  // namespace
}  // namespace unfurl::sim::mesh_hard_test
