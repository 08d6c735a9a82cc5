// Andrews' squeezing mechanism, data/sets/andrews. Source: the Test Set for IVP Solvers (Mazzia and
// Magherini). Quantity: its seven angles at 0.03 s, and over the whole time. Reference: the Test
// Set's values; its seven equations with six constraints (andrews.h), Fehlberg 7(8) at 1e-14.
// Tolerance: 1e-8 [rad], as fine as the printed values have been confirmed.
// Not checked: the multipliers.
#include "andrews.h"

#include <gtest/gtest.h>

#include <cmath>

#include "reference.h"
#include "runs.h"

namespace unfurl::sim::andrews_test {
namespace {

constexpr double kTolerance = 1e-8;  // [rad]
const std::vector<std::string> kAngles = {"beta",  "Theta", "gamma",  "Phi",
                                          "delta", "Omega", "epsilon"};

TEST(Andrews, SevenAngles) {
  constexpr int kSamples = 300;
  SimulateOptions options;
  options.rtol = 1e-12;
  options.rate = kSamples / 0.03;
  const Recorder run = Record(Compile(ReadSet("andrews/scene.toml")), options);
  reference::Integrator integrator;
  const auto states = integrator.Run(
      [](double, const auto& y, auto& rate) { reference::Andrews::RightSide(y, rate); },
      reference::Andrews::Start(), reference::EvenTimes(0.03, kSamples));
  double whole = 0.0;
  for (int k = 0; k < 7; ++k) {
    const std::vector<double> angle = run[kAngles[k] + ".theta"];
    ASSERT_EQ(angle.size(), states.size());
    ExpectWithin("Andrews, " + kAngles[k] + " at 0.03 s [rad]",
                 std::fabs(angle.back() - reference::Andrews::kPublished[k]), kTolerance);
    for (std::size_t i = 0; i < angle.size(); ++i) {
      whole = std::max(whole, std::fabs(angle[i] - states[i][k]));
    }
    EXPECT_NEAR(states.back()[k], reference::Andrews::kPublished[k], kTolerance);
  }
  ExpectWithin("Andrews, all angles over 0.03 s against the Test Set's equations [rad]", whole,
               kTolerance);
}

}  // namespace
}  // namespace unfurl::sim::andrews_test
