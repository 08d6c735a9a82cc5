// The chain of four-bars of data/sets/four_bar_chain, N = 2 and 40, 10 s. Source: problem A02 of the
// IFToMM library of multibody benchmarks (unit links, 1 m/s, 9.81 m/s^2).
// Quantity: the angle of the first rod, and the energy. Reference: the chain's one degree of freedom,
//   ((N + 1) / 3 + N) phi'' = -g cos(phi) ((N + 1) / 2 + N)      (phi from the x axis, unit links),
// Fehlberg 7(8) at 1e-14. The constraints are dependent whenever sin(phi) = 0, twice a turn.
// Tolerance: named below. Not checked: time, which bench/ measures.
#include <gtest/gtest.h>

#include <cmath>

#include "reference.h"
#include "runs.h"

namespace unfurl::sim::four_bar_chain_test {
namespace {

class Chain : public ::testing::TestWithParam<int> {};

TEST_P(Chain, PassesItsFlatStatesAsItsOneEquationDoes) {
  const int n = GetParam();
  SimulateOptions options;
  options.rtol = 1e-8;
  options.rate = 50.0;
  const Recorder run =
      Record(Compile(ReadSet("four_bar_chain/scene_" + std::to_string(n) + ".toml")), options);
  const double inertia = (n + 1) / 3.0 + n, moment = 9.81 * ((n + 1) / 2.0 + n);
  reference::Integrator integrator;
  const auto states = integrator.Run(
      [&](double, const auto& y, auto& dydt) {
        dydt[0] = y[1];
        dydt[1] = -moment / inertia * std::cos(y[0]);
      },
      {M_PI_2, -1.0}, reference::EvenTimes(10.0, 500));
  std::vector<double> phi;
  int flat = 0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    phi.push_back(states[k][0]);
    if (k > 0 && std::sin(states[k][0]) * std::sin(states[k - 1][0]) < 0) ++flat;
  }
  ASSERT_GE(flat, 8);  // it goes round and round
  const std::string name = "chain of " + std::to_string(n) + " four-bars, ";
  // Each of some fourteen crossings magnifies what the constraints are off by: a thousandfold in all.
  ExpectWithin(name + "angle", LargestDifference(run["ground0.theta"], phi), 1e-4);
  const std::vector<double> residual = run["energy.residual"];
  double worst = 0.0;
  for (const double r : residual) worst = std::max(worst, std::fabs(r));
  ExpectWithin(name + "energy", worst / run.kinetic, 1e-5);
  ExpectWithin(name + "drift of the constraints [m]", run.drift, 1e-7);
}
INSTANTIATE_TEST_SUITE_P(Lengths, Chain, ::testing::Values(2, 40));

}  // namespace
}  // namespace unfurl::sim::four_bar_chain_test
