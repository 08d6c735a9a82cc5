// Hard cases of contact, graded: each run must end, and its end must be right.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "tests/source_dir.h"

namespace unfurl::sim::contact_hard_test {
namespace {

data::Scene BouncingLatch() {
  return data::ReadScene(std::string(UNFURL_SOURCE_DIR) + "/data/sets/bouncing_latch/scene.toml");
}

struct LastRow : Observer {
  explicit LastRow(const Model& model) : observables(model) {}
  void OnSample(double t, double* y, const std::vector<LatchMode>& modes) override {
    row = observables.Row(t, y, modes);
  }
  double operator[](const std::string& name) const {
    for (std::size_t k = 0; k < row.size(); ++k) {
      if (observables.quantities()[k].name == name) return row[k];
    }
    ADD_FAILURE() << name;
    return NAN;
  }
  Observables observables;
  std::vector<double> row;
};

// Depth at which the Hertz spring of the lower stop holds the torsion spring, by bisection [rad].
double RestAngle(const data::Scene& scene) {
  const auto& spring = *scene.joints[0].spring;
  const auto& latch = *scene.joints[0].latch;
  double low = 0.0, high = 0.1;
  for (int k = 0; k < 80; ++k) {
    const double depth = 0.5 * (low + high), theta = -latch.theta_b - depth;
    const double push = latch.lever * scene.contacts[0].K * std::pow(latch.lever * depth, 1.5);
    (push < spring.stiffness * (theta + spring.preload) ? low : high) = depth;
  }
  return -latch.theta_b - low;
}

// Grade 1 to 3: the paper's contact, a hundred times stiffer, a hundred times softer. Rule: 30 s of
// chatter end, every impact is counted, and the arm rests where the two springs balance.
class StiffChatter : public ::testing::TestWithParam<double> {};

TEST_P(StiffChatter, EndsAtRest) {
  data::Scene scene = BouncingLatch();
  scene.contacts[0].K *= GetParam();
  scene.contacts[0].C *= std::max(1.0, GetParam());  // else the stiff one bounces for minutes
  scene.duration = 30.0;
  const Model model = Compile(scene);
  LastRow last(model);
  SimulateOptions options;
  options.rate = 10.0;
  const SimulateReport report = Simulate(model, options, &last);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_EQ(report.t_end, 30.0);
  EXPECT_GE(report.Count(EventKind::kContactStart), 5);
  // What is left of the bouncing after 30 s, some 1e-4 of the clearance.
  constexpr double kLeft = 2e-6;  // [rad]
  EXPECT_NEAR(last["hinge.theta"], RestAngle(scene), kLeft);
}
INSTANTIATE_TEST_SUITE_P(Stiffness, StiffChatter, ::testing::Values(1.0, 100.0, 0.01));

// Grade 4: no clearance, no damping: the two stops meet and nothing is lost. Rule: 2 s end and the
// energy is kept to 1e-6 of its scale.
TEST(ContactHard, TwoStopsThatMeetAndNoDamping) {
  data::Scene scene = BouncingLatch();
  scene.joints[0].latch->theta_a = scene.joints[0].latch->theta_b = 0.0;
  scene.contacts[0].C = 0.0;
  scene.duration = 2.0;
  const Model model = Compile(scene);
  LastRow last(model);
  SimulateOptions options;
  options.rtol = 1e-9;
  const SimulateReport report = Simulate(model, options, &last);
  ASSERT_TRUE(report.Usable()) << report.message;
  const double scale = last.observables.energy_at_start();
  EXPECT_GT(report.Count(EventKind::kContactStart), 100);
  EXPECT_LT(std::fabs(last["energy.residual"]), 1e-6 * scale);
}

}  // namespace
}  // namespace unfurl::sim::contact_hard_test
