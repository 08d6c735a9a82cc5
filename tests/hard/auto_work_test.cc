// `auto` against the best of the program's own methods, in right sides: no test asserts a time.
// UNFURL_AUTO_SCENES sets how many scenes, from UNFURL_FIRST_SCENE on (tests/hard/CMakeLists.txt).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "sim/methods/simulate.h"
#include "tests/hard/random_scenes.h"
#include "tests/hard/run_of.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::auto_work_test {
namespace {

constexpr double kNone = 1e9;         // error of a run that is not usable [m]
constexpr double kMostRatio = 2.0;    // the promise
constexpr double kReference = 1e-10;  // rtol
// Right sides: what 500 steps of the longest length cost by the dearest method, implicit steps of
// 28 with what they cost beside their right sides.
constexpr double kShort = 14500.0;
constexpr int kFirst = 1007;          // none of the scenes that the rules were found with

double ErrorOf(const MarkTracks& run, const MarkTracks& truth) {
  if (!run.report.Usable() || run.t.size() != truth.t.size()) return kNone;
  return Apart(run, truth);
}

// Whether a method on its own reaches the error with less than half of the work, at any tolerance.
bool Beaten(const Model& model, const MarkTracks& truth, double error, double work) {
  for (const auto& [method, order] : {std::pair{Method::kProjected, 4},
                                      {Method::kProjected, 5},
                                      {Method::kProjected, 8},
                                      {Method::kImplicit, 0}}) {
    for (const double rtol : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
      const MarkTracks run = RunOf(model, method, order, rtol);
      if (kMostRatio * run.report.work > work) break;  // tighter is dearer
      if (ErrorOf(run, truth) <= error) return true;
    }
  }
  return false;
}

int FromEnvironment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atoi(text) : otherwise;
}

TEST(AutoWork, IsAtMostTwiceTheBestMethods) {
  const int count = FromEnvironment("UNFURL_AUTO_SCENES", 10);
  const int first = FromEnvironment("UNFURL_FIRST_SCENE", kFirst);
  int runs = 0, beaten = 0, brief = 0, refused = 0;
  for (int seed = first; seed < first + count; ++seed) {
    const auto drawn = static_cast<std::uint64_t>(seed);
    const RandomScene scene = seed % 2 == 0 ? DrawStiffScene(drawn) : DrawScene(drawn);
    SCOPED_TRACE(fmt::format("seed {}", seed));
    const Model model = ModelFrom(scene.toml);
    const MarkTracks truth = RunOf(model, Method::kAuto, 0, kReference);
    if (!truth.report.Usable()) continue;
    for (const double rtol : {1e-3, 1e-5, 1e-7}) {
      const MarkTracks run = RunOf(model, Method::kAuto, 0, rtol);
      ++runs;
      if (!run.report.Usable()) {
        ++refused;
        EXPECT_FALSE(run.report.message.empty());
        continue;
      }
      if (!Beaten(model, truth, ErrorOf(run, truth), run.report.work)) continue;
      ++(run.report.work > kShort ? beaten : brief);
      fmt::print("seed {} at {:.0e}: {:.0f} right sides, more than twice the best\n", seed, rtol,
                 run.report.work);
    }
  }
  fmt::print("{} runs, {} refused, {} above twice the best, and {} of under {:.0f} right sides\n",
             runs, refused, beaten, brief, kShort);
  EXPECT_GE(runs, 2 * count);
  // 98%, and of a few runs one.
  EXPECT_LE(beaten, std::max(1, runs / 50));
}

}  // namespace
}  // namespace unfurl::sim::auto_work_test
