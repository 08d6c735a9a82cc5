// Scenes by seed: `auto` keeps its promise, or says that it does not.
#include "tests/hard/random_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "sim/methods/simulate.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::random_scenes_test {
namespace {

MarkTracks MarksOf(const Model& model, double rtol) {
  SimulateOptions options;
  options.rtol = rtol;
  options.rate = 100.0;
  return SimulateMarks(model, options);
}

// Within ten tolerances of a run a thousand times tighter, which past 1e-7 is of another order too;
// or warned of; within a hundred where latches magnify what is off (docs/accuracy.md). A run that
// is not usable has a message. UNFURL_RANDOM_SCENES sets how many, from UNFURL_FIRST_SCENE on.
TEST(RandomScenes, WithinTenTolerances) {
  const char* wanted = std::getenv("UNFURL_RANDOM_SCENES");
  const int count = wanted != nullptr ? std::atoi(wanted) : 10;
  constexpr double kRtol = 1e-5;
  int usable = 0, warned = 0;
  const char* first = std::getenv("UNFURL_FIRST_SCENE");
  const int start = first != nullptr ? std::atoi(first) : 1;
  for (int seed = start; seed < start + count; ++seed) {
    const RandomScene scene = DrawScene(static_cast<std::uint64_t>(seed));
    SCOPED_TRACE(fmt::format("seed {}", seed));
    const Model model = ModelFrom(scene.toml);
    const MarkTracks run = MarksOf(model, kRtol);
    if (!run.report.Usable()) {
      EXPECT_FALSE(run.report.message.empty());
      continue;
    }
    ++usable;
    const MarkTracks truth = MarksOf(model, 1e-3 * kRtol);
    ASSERT_TRUE(truth.report.Usable()) << truth.report.message;
    ASSERT_EQ(run.t.size(), truth.t.size());
    double off = 0.0;
    for (std::size_t m = 0; m < run.x.size(); ++m) {
      for (std::size_t k = 0; k < run.t.size(); ++k) {
        off = std::max(off, std::hypot(run.x[m][k] - truth.x[m][k], run.y[m][k] - truth.y[m][k]));
      }
    }
    const double allowed = (scene.latches ? 100.0 : 10.0) * kRtol * model.length_scale;
    warned += run.report.warnings.empty() ? 0 : 1;
    EXPECT_TRUE(off < allowed || !run.report.warnings.empty()) << off << " of " << allowed << "\n"
                                                               << scene.toml;
  }
  EXPECT_GE(usable, count * 8 / 10);
  EXPECT_LE(warned, count * 2 / 10);  // a warning for everything would be no promise
}

}  // namespace
}  // namespace unfurl::sim::random_scenes_test
