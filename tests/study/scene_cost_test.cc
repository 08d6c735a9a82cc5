#include "study/scene_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "base/cpu_time.h"
#include "base/error.h"
#include "data/scene.h"
#include "sim/implicit/find_modes.h"
#include "study/cost_meshes.h"
#include "tests/own_folder.h"
#include "tests/study/cost_scenes.h"
#include "tests/study/cost_truth.h"

namespace unfurl::study::scene_cost_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A beam clamped to the ground under gravity and a rigid pendulum at its end.
constexpr char kMixed[] =
    "[scene]\nname = 'mixed'\nduration = 0.4\n"
    "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 20.0\nsegments = 4\n"
    "[body.bob]\nmass = 0.3\ninertia = 0.01\n"
    "[weld.root]\ninner = 'ground'\nouter = 'rod.start'\n"
    "[joint.pin]\ninner = 'rod.end'\nouter = 'bob'\nouter_point = [0.0, 0.2]\ntheta = 0.5\n"
    "[event.low]\nwhen = 'pin.theta'\nlevel = 0.0\ndirection = 'falling'\n"
    "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = 'rod.end'\n";

std::vector<std::string> Names(const std::vector<CostQuantity>& quantities) {
  std::vector<std::string> names;
  for (const CostQuantity& q : quantities) names.push_back(q.name);
  return names;
}

TEST(CostQuantities, AreWhatAPersonLooksAt) {
  const data::Scene scene = data::ParseScene(kMixed, "mixed");
  EXPECT_THAT(Names(CostQuantities(scene, {})),
              ElementsAre("tip", "pin.theta", "pin.peak_pin_force", "low.time"));
  EXPECT_THAT(Names(CostQuantities(scene, {"bob.*x", "frequency.2", "tip", "tip"})),
              ElementsAre("bob.x", "bob.vx", "frequency.2", "tip"));
  EXPECT_TRUE(CostQuantities(scene, {"pin.theta_rate"})[0].jumps);
  EXPECT_FALSE(CostQuantities(scene, {"pin.theta"})[0].jumps);
  try {
    CostQuantities(scene, {"pin.thet"});
    FAIL();
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), HasSubstr("did you mean 'pin.theta'?"));
  }
  EXPECT_THROW(CostQuantities(scene, {"frequency.0"}), Error);
}

// What is run is what the words set, of scenes with one mesh, several, and either model.
TEST(CostMeshes, AreWhatTheirOverridesMake) {
  const OwnFolder folder;
  folder.Put("scene.toml",
             "[scene]\nname = 'three'\nduration = 1.0\n"
             "[beam.a]\nlength = 1.0\nmass = 1.0\nEI = 9.0\nsegments = 5\n"
             "[beam.\"b c\"]\nlength = 1.0\nmass = 1.0\nEI = 9.0\n"
             "[beam.d]\nlength = 1.0\nmass = 1.0\nEI = 9.0\nmodel = 'kirchhoff'\norder = 2\n"
             "[weld.w1]\ninner = 'ground'\nouter = 'a.start'\n"
             "[weld.w2]\ninner = 'a.end'\nouter = 'b c.start'\n"
             "[weld.w3]\ninner = 'b c.end'\nouter = 'd.start'\n[mark.m]\non = 'd.end'\n");
  const data::Scene scene = data::ReadScene(folder.File("scene.toml"));
  CostMeshes meshes = MeshesOf(scene, {}, {});
  EXPECT_EQ(meshes.asked.size(), 7u);
  std::vector<CostMesh> all = meshes.asked;
  all.insert(all.end(), meshes.segments.begin(), meshes.segments.end());
  all.insert(all.end(), meshes.smooth.begin(), meshes.smooth.end());
  std::set<std::string> words;
  for (const CostMesh& mesh : all) {
    const data::Scene made = mesh.Of(scene);
    const data::Scene read = data::ReadScene(folder.File("scene.toml"), mesh.set);
    for (std::size_t b = 0; b < scene.beams.size(); ++b) {
      EXPECT_EQ(made.beams[b].model, read.beams[b].model) << mesh.words;
      const bool smooth = made.beams[b].model == data::BeamModel::kKirchhoff;
      EXPECT_EQ(smooth ? made.beams[b].order : made.beams[b].segments,
                smooth ? read.beams[b].order : read.beams[b].segments)
          << mesh.words;
    }
    words.insert(mesh.words);
  }
  EXPECT_THAT(words, Contains("3 to 4 segments"));
  EXPECT_THAT(words, Contains("smooth, order 8"));
  // The reference's meshes reach the finest that is asked, and double.
  for (std::size_t b = 0; b < scene.beams.size(); ++b) {
    EXPECT_GE(meshes.segments[2].beams[b].size, meshes.asked[2].beams[b].size);
    EXPECT_EQ(meshes.segments[2].beams[b].size, 4 * meshes.segments[0].beams[b].size);
  }
  CostSetting setting;
  setting.set = {"beam.b c.segments=8", "solver.rtol=0.001"};
  EXPECT_EQ(setting.SetText(), "--set 'beam.b c.segments=8' --set solver.rtol=0.001");
  EXPECT_THROW(MeshesOf(scene, {0}, {}), Error);
  EXPECT_THROW(MeshesOf(scene, {}, {12}), Error);
}

// They may be smooth; of the printed form, which is of segments, they may not.
TEST(CostMeshes, BeamsThatStretchMayBeSmooth) {
  for (const CostScene& s : CostScenes()) {
    if (std::string(s.name) != "rope that stretches") continue;
    data::Scene scene = data::ParseScene(s.text, s.name);
    EXPECT_FALSE(MeshesOf(scene, {}, {}).smooth.empty());
    EXPECT_NO_THROW(MeshesOf(scene, {}, {2}));
    scene.beams[0].gradient_form = false;
    EXPECT_TRUE(MeshesOf(scene, {}, {}).smooth.empty());
    EXPECT_THROW(MeshesOf(scene, {}, {2}), Error);
  }
}

// A point of a study that was made up.
CostPoint Made(double seconds, double scatter, double rms) {
  CostPoint p;
  p.usable = true;
  p.seconds = seconds;
  p.scatter = scatter;
  p.worst = 0;
  p.rms = rms;
  p.errors = {{rms, rms, false}};
  p.setting.method = "auto";
  return p;
}

TEST(CostAdvice, TakesTheMoreAccurateOfWhatIsAsCheap) {
  SceneCost cost;
  cost.lines.resize(1);
  cost.lines[0].settled = true;
  cost.points = {Made(1.0, 0.05, 5e-3), Made(1.1, 0.05, 2e-3), Made(1.5, 0.05, 1e-3),
                 Made(0.5, 0.01, 2e-2)};
  EXPECT_EQ(Cheapest(cost, 1e-2), &cost.points[1]);
  EXPECT_EQ(Cheapest(cost, 1e-3), &cost.points[2]);
  EXPECT_EQ(Cheapest(cost, 1e-4), nullptr);
  EXPECT_EQ(Cheapest(cost, 5e-2, 0), &cost.points[3]);
}

// What a person reads stands apart from what is typed.
TEST(CostAdvice, SaysInWordsWhatASetTextDoes) {
  SceneCost cost;
  cost.lines.resize(1);
  cost.lines[0].settled = true;
  cost.lines[0].quantity.name = "tip";
  cost.points = {Made(1.5, 0.05, 5e-4)};
  cost.points[0].setting.method = "auto";
  cost.points[0].setting.set = {"solver.rtol=0.001"};
  const std::vector<CostCounsel> counsels = CostCounsels(cost);
  ASSERT_EQ(counsels.size(), 3u);
  EXPECT_EQ(counsels[0].set, "--set solver.rtol=0.001");
  EXPECT_EQ(counsels[0].words.find("--"), std::string::npos);
  EXPECT_NE(counsels[0].words.find("1.5 s"), std::string::npos);
  EXPECT_NE(counsels[0].words.find("tip: 0.05 %"), std::string::npos);
  EXPECT_EQ(counsels[2].set, "");
  EXPECT_EQ(CostAdvice(cost)[0], counsels[0].words + ": --set solver.rtol=0.001");
}

TEST(CostPercent, IsAlwaysAShareOfAHundred) {
  EXPECT_EQ(CostPercent(0.0034), "0.34 %");
  EXPECT_EQ(CostPercent(2.1e-7), "2.1e-05 %");
  EXPECT_EQ(CostPercent(3.1e-5), "0.0031 %");
}

// The quick ones of twelve: beams of both models, and a rigid mechanism.
TEST(SceneCost, StatedErrorsAreReal) {
  for (const char* name : {"mast on a spring", "rigid gate with a drag and a table"}) {
    for (const CostScene& s : CostScenes()) {
      if (std::string(s.name) != name) continue;
      const data::Scene scene = data::ParseScene(s.text, s.name);
      SceneCostOptions options;
      options.quantities = s.quantities;
      options.methods = {"auto"};
      options.duration = scene.beams.empty() ? 1.5 : 0.3;
      options.repeats = 0.0;
      const SceneCost cost = StudySceneCost(scene, options);
      ASSERT_TRUE(cost.Usable());
      const CostTally tally = HeldToTruth(scene, options, cost, 32, 9);
      EXPECT_EQ(tally.wrong, 0) << name << ": " << tally.worst;
      EXPECT_EQ(tally.low_bounds, 0) << name;
      EXPECT_GE(tally.resolved, 4) << name;
    }
  }
}

// Euler and Bernoulli: the clamped beam's frequencies are (k L)^2 sqrt(EI / (m L^3)) / (2 pi).
TEST(SceneCost, StatedErrorsOfFrequenciesAreThoseToTheClosedForm) {
  const data::Scene scene = data::ParseScene(
      "[scene]\nname = 'bar'\nduration = 0.01\n"
      "[beam.bar]\nlength = 0.7\nmass = 0.9\nEI = 45.0\nsegments = 10\n"
      "[weld.root]\ninner = 'ground'\nouter = 'bar.start'\n",
      "bar");
  SceneCostOptions options;
  options.quantities = {"frequency.1", "frequency.2"};
  options.segments = {5, 10, 20};
  options.methods = {"auto"};
  options.tolerances = {1e-3};
  options.repeats = 0.0;
  const SceneCost cost = StudySceneCost(scene, options);
  ASSERT_EQ(cost.lines.size(), 2u);
  ASSERT_EQ(cost.points.size(), 3u);
  const double unit = std::sqrt(45.0 / (0.9 * std::pow(0.7, 3))) / (2.0 * M_PI);
  constexpr double kRoots[] = {1.875104068711961, 4.694091132974175};  // of cos cosh = -1
  for (std::size_t l = 0; l < 2; ++l) {
    const double truth = kRoots[l] * kRoots[l] * unit;
    for (const CostPoint& p : cost.points) {
      sim::ModesOptions modes;
      const CostMesh mesh = MeshesOf(scene, {p.setting.segments}, {}).asked[0];
      const double found = sim::FindModes(mesh.Of(scene), modes).record.modes[l].frequency;
      EXPECT_NEAR(p.errors[l].rms * truth / std::fabs(found - truth), 1.0, 0.2)
          << p.setting.Name() << ", " << cost.lines[l].quantity.name;
      EXPECT_FALSE(p.errors[l].bound);
    }
  }
  EXPECT_TRUE(cost.refused.empty());  // smooth beams of the reference have them, too
}

TEST(SceneCost, ABudgetIsKept) {
  const data::Scene scene = data::ParseScene(kMixed, "mixed");
  SceneCostOptions options;
  options.within = 0.3;
  const double start = CpuSeconds();
  const SceneCost cost = StudySceneCost(scene, options);
  // Beyond it by what lies between two looks at the clock.
  EXPECT_LT(CpuSeconds() - start, 2.0 * options.within);
  EXPECT_TRUE(!cost.problem.empty() || cost.left_out > 0 || cost.seconds < options.within);
  // What one method costs and gains at every tolerance comes before other methods.
  int tightest = 0, others = 0;
  for (const CostPoint& p : cost.points) {
    tightest += p.setting.method == options.methods[0] && p.setting.tolerance < 1e-3 ? 1 : 0;
    others += p.setting.method != options.methods[0] ? 1 : 0;
  }
  EXPECT_TRUE(others == 0 || tightest > 0);
  // No claim about meshes that there was no time for.
  options.within = 0.02;
  const SceneCost little = StudySceneCost(scene, options);
  EXPECT_TRUE(!little.problem.empty() || little.reference_cut);
  options.within = 1e-6;
  EXPECT_FALSE(StudySceneCost(scene, options).problem.empty());
}

TEST(SceneCost, ResultsDoNotDependOnTheNumberOfWorkers) {
  const data::Scene scene = data::ParseScene(kMixed, "mixed");
  SceneCostOptions options;
  options.segments = {3};
  options.orders = {2};
  options.tolerances = {1e-3};
  options.methods = {"auto"};
  options.duration = 0.1;
  options.quantities = {"tip", "pin.theta_rate", "low.time", "frequency.1"};
  std::vector<SceneCost> costs;
  for (const std::size_t workers : {1, 2}) {
    options.workers = workers;
    costs.push_back(StudySceneCost(scene, options));
  }
  ASSERT_EQ(costs[0].points.size(), 2u);
  ASSERT_EQ(costs[0].lines.size(), costs[1].lines.size());
  for (std::size_t l = 0; l < costs[0].lines.size(); ++l) {
    EXPECT_EQ(costs[0].lines[l].reference_error, costs[1].lines[l].reference_error);
    for (std::size_t p = 0; p < 2; ++p) {
      EXPECT_EQ(costs[0].points[p].errors[l].rms, costs[1].points[p].errors[l].rms);
    }
  }
}

}  // namespace
}  // namespace unfurl::study::scene_cost_test
