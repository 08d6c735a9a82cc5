#include "correlate/fit/cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"

namespace unfurl::correlate {
namespace {

constexpr int kSamples = 400;

// A point on a circle of radius 1 (range 2 sqrt 2) whose path is off by `error` along x, and one
// that stands nearly still, off by the same.
CostRun RunOff(const std::string& method, double tolerance, int mesh, double error,
               double seconds) {
  CostRun run{{method, tolerance, mesh}, true, {}, seconds, {}, {}};
  run.x.resize(2);
  run.y.resize(2);
  for (int i = 0; i < kSamples; ++i) {
    const double a = 2.0 * M_PI * i / kSamples;
    run.x[0].push_back(std::cos(a) + error);
    run.y[0].push_back(std::sin(a));
    run.x[1].push_back(5.0 + error);
    run.y[1].push_back(1e-9 * i);
  }
  return run;
}

const double kRange = std::sqrt(8.0);

TEST(Cost, ErrorIsTheDistanceOverTheRange) {
  const CostRun reference = RunOff("a", 1e-9, 0, 0.0, 1.0);
  CostRun run = RunOff("a", 1e-4, 0, 0.01, 1.0);
  const CostPoint point = CompareCost(run, reference);
  // The still point is measured by the widest range, not by its own, which is nothing.
  EXPECT_NEAR(point.rms, 0.01 / kRange, 1e-12);
  EXPECT_NEAR(point.largest, 0.01 / kRange, 1e-12);
  run.x[0][7] += 0.5;
  EXPECT_NEAR(CompareCost(run, reference).largest, 0.51 / kRange, 1e-12);
  EXPECT_NEAR(CompareCost(run, reference).rms,
              std::sqrt((399 * 1e-4 + 0.51 * 0.51) / kSamples) / kRange, 1e-12);
  run.x[0].pop_back();
  EXPECT_THROW(CompareCost(run, reference), Error);
}

TEST(Cost, TheFrontHoldsWhatNothingBeats) {
  const CostRun reference = RunOff("a", 1e-9, 0, 0.0, 9.0);
  std::vector<CostRun> runs = {
      RunOff("a", 1e-3, 0, 0.1, 1.0),   // front: the fastest
      RunOff("b", 1e-3, 0, 0.2, 1.5),   // slower and worse
      RunOff("a", 1e-5, 0, 1e-3, 2.0),  // front
      RunOff("b", 1e-5, 0, 1e-3, 2.5),  // as good, slower
      RunOff("a", 1e-7, 0, 1e-5, 4.0),  // front
  };
  runs.push_back(RunOff("c", 1e-5, 0, 0.0, 0.1));
  runs.back().usable = false;
  const CostStudy study = StudyCost(runs, reference, nullptr);
  std::vector<bool> front;
  for (const CostPoint& p : study.points) front.push_back(p.on_front);
  EXPECT_EQ(front, (std::vector<bool>{true, false, true, false, true, false}));
  EXPECT_EQ(Cheapest(study, 1e-2)->setting.tolerance, 1e-5);
  EXPECT_EQ(Cheapest(study, 1e-2)->setting.method, "a");
  EXPECT_EQ(Cheapest(study, 1e-9), nullptr);
}

TEST(Cost, AdviceStopsAtWhatTheFinestRunsResolve) {
  const CostRun reference = RunOff("a", 1e-9, 0, 0.0, 9.0);
  const CostRun second = RunOff("b", 1e-9, 0, 1e-3 * kRange, 9.0);  // floor 0.1%
  const CostStudy study = StudyCost({RunOff("a", 1e-4, 0, 1e-3, 1.0)}, reference, &second);
  EXPECT_NEAR(study.floor, 1e-3, 1e-12);
  const std::vector<std::string> advice = CostAdvice(study);
  ASSERT_EQ(advice.size(), 2u);
  EXPECT_THAT(advice[0], ::testing::HasSubstr("1 %: a, rtol 0.0001, 1 s"));
  EXPECT_THAT(advice[1], ::testing::HasSubstr("cannot be judged"));
}

TEST(Cost, AdviceNamesTheMeshThatIsLeft) {
  const CostRun reference = RunOff("a", 1e-9, 16, 0.0, 9.0);
  const CostStudy study = StudyCost(
      {RunOff("a", 1e-4, 4, 0.1, 1.0), RunOff("a", 1e-6, 4, 0.0999, 3.0)}, reference, nullptr);
  const std::vector<std::string> advice = CostAdvice(study);
  EXPECT_THAT(advice.back(), ::testing::HasSubstr("With 4 segments the mesh is what is left"));
  EXPECT_THAT(advice.back(), ::testing::HasSubstr("below 0.0001 is wasted"));
}

}  // namespace
}  // namespace unfurl::correlate
