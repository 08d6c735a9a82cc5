// The share of seeds within a factor of 1.5 in 5000 runs, and how often the stated interval holds.
#include <gtest/gtest.h>

#include "campaign/statistics/rare_failure.h"
#include "tests/campaign/coverage.h"
#include "tests/campaign/margins.h"

namespace unfurl::campaign::rare_failure_slow_test {
namespace {

struct Study {
  MarginCase margin;
  double within;  // share of seeds within a factor of 1.5, at the least
};

void PrintTo(const Study& s, std::ostream* out) { *out << s.margin.name; }

class RareStudy : public testing::TestWithParam<Study> {};
// What noise adds to a margin no proposal foresees: there it is what subset simulation alone can
// do.
INSTANTIATE_TEST_SUITE_P(
    All, RareStudy,
    testing::Values(Study{Linear(2, 1e-4), 0.95}, Study{Linear(10, 1e-4), 0.95},
                    Study{Linear(100, 1e-4), 0.95}, Study{FourBranch(1.0), 0.95},
                    Study{Sphere(10, 1e-4), 0.95}, Study{Exponentials(20, 1e-4), 0.95},
                    Study{TwoSided(50, 1e-4), 0.95}, Study{Corner(8, 1e-4), 0.95},
                    Study{Steps(10, 3.9), 0.95}, Study{Planes(10, {3.9, 4.0, 4.1, 4.3}), 0.95},
                    Study{Planes(11, std::vector<double>(10, 4.26)), 0.9},
                    Study{Planes(60, {3.9, 4.0, 4.1, 4.3}), 0.95}, Study{Noisy(5, 1e-4), 0.7}),
    [](const auto& the) { return the.param.margin.name; });

TEST_P(RareStudy, ShareWithinAFactorOfOneAndAHalf) {
  const auto& [c, least] = GetParam();
  constexpr int kRepeats = 60;
  std::vector<double> off, told;
  int within = 0, held = 0, importance = 0;
  for (std::uint64_t seed = 1; seed <= kRepeats; ++seed) {
    RareFailure rare({.dimensions = c.dimensions, .runs = 5000, .seed = seed});
    Drive(&rare, c.margin);
    const RareFailureResult& r = rare.result();
    EXPECT_LE(r.runs, 5000u);
    off.push_back(std::log(r.probability / c.probability));
    told.push_back(r.variation);
    within += std::abs(off.back()) < std::log(1.5);
    held += r.interval.low <= c.probability && c.probability <= r.interval.high;
    importance += r.method == RareMethod::kImportance;
  }
  std::printf(
      "%s: p %.3g, mean of log %+.3f, scatter %.3f, told %.3f; of %d seeds %d within 1.5, %d in "
      "their "
      "interval, %d by importance sampling\n",
      c.name.c_str(), c.probability, Mean(off), std::sqrt(Variance(off)), Mean(told), kRepeats,
      within, held, importance);
  std::fflush(stdout);
  EXPECT_GE(1.0 * within / kRepeats, least - ShareError(least, kRepeats));
  EXPECT_GE(1.0 * held / kRepeats, 0.9 - ShareError(0.9, kRepeats));
}

}  // namespace
}  // namespace unfurl::campaign::rare_failure_slow_test
