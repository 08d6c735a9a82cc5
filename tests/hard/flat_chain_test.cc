// The chain of N four-bars (data/sets/four_bar_chain) through its flat states, in which all its
// constraints of one direction depend on one another and it could fold into another mechanism.
// Success: 10 s with every method, at loose and tight tolerances, the angle of the one equation
// that the chain follows as long as its rods stay parallel.
#include <gtest/gtest.h>

#include <cmath>

#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"
#include "tests/source_dir.h"
#include "verification/reference.h"

namespace unfurl::sim::flat_chain_test {
namespace {

constexpr double kDuration = 10.0;
// The top of a rod, over the tolerance: some seven crossings, each of which magnifies what the
// constraints are off by. Measured: up to 2e3 (projected) and 2e4 (partitioned).
constexpr double kAllowed = 3e4;

struct Case {
  int n;
  Method method;
  double rtol;
};

class FlatChain : public ::testing::TestWithParam<Case> {};

TEST_P(FlatChain, IsPassed) {
  const Case c = GetParam();
  const Model model =
      Compile(data::ReadScene(std::string(UNFURL_SOURCE_DIR) + "/data/sets/four_bar_chain/scene_" +
                              std::to_string(c.n) + ".toml"));
  ASSERT_FALSE(model.marks.empty());
  SimulateOptions options;
  options.method = c.method;
  options.rtol = c.rtol;
  options.duration = kDuration;
  options.rate = 10.0;
  const MarkTracks tracks = SimulateMarks(model, options);
  ASSERT_TRUE(tracks.report.Usable()) << tracks.report.message;
  EXPECT_GT(tracks.report.near_dependence, 3);
  EXPECT_LT(tracks.report.rejected, tracks.report.steps / 4);

  const double n = c.n, inertia = (n + 1) / 3.0 + n, moment = 9.81 * ((n + 1) / 2.0 + n);
  reference::Integrator integrator;
  const auto states = integrator.Run(
      [&](double, const auto& y, auto& dydt) {
        dydt[0] = y[1];
        dydt[1] = -moment / inertia * std::cos(y[0]);
      },
      {M_PI_2, -1.0}, reference::EvenTimes(kDuration, 100));
  ASSERT_EQ(states.size(), tracks.t.size());
  double worst = 0.0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    worst = std::max(worst, std::hypot(tracks.x[0][k] - std::cos(states[k][0]),
                                       tracks.y[0][k] - std::sin(states[k][0])));
  }
  RecordProperty("error over rtol", std::to_string(worst / c.rtol));
  EXPECT_LT(worst, kAllowed * c.rtol);
}
INSTANTIATE_TEST_SUITE_P(
    All, FlatChain,
    ::testing::Values(Case{2, Method::kProjected, 1e-6}, Case{2, Method::kProjected, 1e-9},
                      Case{2, Method::kPartitioned, 1e-6}, Case{2, Method::kPartitioned, 1e-9},
                      Case{40, Method::kProjected, 1e-7}, Case{40, Method::kPartitioned, 1e-7}));

}  // namespace
}  // namespace unfurl::sim::flat_chain_test
