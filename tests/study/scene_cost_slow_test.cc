// Twelve scenes, six of them not ours: what `unfurl cost` states against real errors.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "data/scene.h"
#include "tests/source_dir.h"
#include "tests/study/cost_scenes.h"
#include "tests/study/cost_truth.h"

namespace unfurl::study::scene_cost_slow_test {
namespace {

TEST(SceneCostSlow, StatedErrorsAreReal) {
  const char* only = std::getenv("UNFURL_COST_SCENE");
  for (const CostScene& s : CostScenes()) {
    if (only != nullptr && std::string(s.name) != only) continue;
    const data::Scene scene =
        s.shipped[0] != '\0'
            ? data::ReadScene(std::string(UNFURL_SOURCE_DIR "/data/sets/") + s.shipped)
            : data::ParseScene(s.text, s.name);
    SceneCostOptions options;
    options.quantities = s.quantities;
    options.duration = s.duration;
    const SceneCost cost = StudySceneCost(scene, options);
    const CostTally t = HeldToTruth(scene, options, cost, s.finest, 11);
    fmt::print(
        "{}: {} settings in {:.3g} s; {} resolved, stated over real {:.2f} to {:.2f}, {} "
        "wrong; {} bounds, {} low; {} not settled, {} beyond the truth {}\n",
        s.name, cost.points.size(), cost.seconds, t.resolved, t.least, t.most, t.wrong, t.bounds,
        t.low_bounds, t.unsettled, t.doubtful, t.worst);
    std::fflush(stdout);
    EXPECT_EQ(t.wrong, 0) << s.name << ": " << t.worst;
    EXPECT_EQ(t.low_bounds, 0) << s.name;
    EXPECT_GT(t.resolved, 0) << s.name;
  }
}

}  // namespace
}  // namespace unfurl::study::scene_cost_slow_test
