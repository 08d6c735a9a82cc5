// The deployment of the paper, sections 2, 5 and 7: conservation, convergence, latching.
// Source: the laws of mechanics, and the values of [paper, Table 1 and section 5].
// Not checked here: the paper's figures, whose fold and damping are not printed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "data/scene.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"
#include "tests/source_dir.h"

namespace unfurl::sim::deployment_test {
namespace {

data::Scene Deployment(const std::string& variant, int segments = 0, double damping = 0.0) {
  data::Scene scene = data::ReadScene(std::string(UNFURL_SOURCE_DIR) +
                                      "/data/sets/deployment/scene_" + variant + ".toml");
  for (auto& beam : scene.beams) {
    if (segments > 0) beam.segments = segments;
    beam.damping = damping;
  }
  return scene;
}

// The largest departures from the balances over a run.
struct Books : Observer {
  explicit Books(const Model& model) : observables(model) {}
  void OnSample(double t, double* y, const std::vector<LatchMode>& modes) override {
    observables.Row(t, y, modes);
    const Balance& b = observables.balance();
    if (!started) start = b, started = true;
    energy =
        std::max(energy, std::fabs(b.Stored() + b.Dissipated() - observables.energy_at_start()));
    momentum = std::max(
        momentum, std::hypot(b.momentum_x - start.momentum_x, b.momentum_y - start.momentum_y));
    angular = std::max(angular, std::fabs(b.angular_momentum - start.angular_momentum));
    centre = std::max(centre, std::hypot(b.centre_x - start.centre_x, b.centre_y - start.centre_y));
    drift = std::max(drift, b.position_drift);
    least_lost = std::min(least_lost, b.Dissipated() - last_lost);
    last_lost = b.Dissipated();
    spin = std::max(spin, std::fabs(b.kinetic));
  }
  Observables observables;
  Balance start;
  bool started = false;
  double energy = 0, momentum = 0, angular = 0, centre = 0, drift = 0, least_lost = 0,
         last_lost = 0, spin = 0;
};

class Variant : public ::testing::TestWithParam<std::string> {};

TEST_P(Variant, FourLatchWithinFiveSeconds) {
  const data::Scene scene = Deployment(GetParam());
  const bool eight = GetParam() == "suspension" || GetParam().ends_with("_8");
  for (const auto& beam : scene.beams) ASSERT_EQ(beam.segments, eight ? 8 : 4);
  const Model model = Compile(scene);
  const SimulateReport report = Simulate(model, {}, nullptr);
  ASSERT_TRUE(report.Usable()) << report.message;
  EXPECT_EQ(report.t_end, 5.0);
  std::vector<int> latched(4, 0);
  for (const Event& e : report.events) {
    if (e.kind == EventKind::kLatch) ++latched[e.latch];
  }
  EXPECT_EQ(latched, std::vector<int>(4, 1));
}
INSTANTIATE_TEST_SUITE_P(Scenes, Variant,
                         ::testing::Values("clearance", "no_clearance", "suspension", "clearance_8",
                                           "no_clearance_8", "suspension_4"));

// Without suspension nothing acts from outside: momentum stays zero to rounding, angular momentum
// to the tolerance, and what is not stored is dissipated. With damping both ways of losing are at
// work. `auto` may take implicit steps, whose linear systems are solved to rounding times their
// condition: momentum is kept to the tolerance there.
TEST(DeploymentBalance, EnergyAndMomentum) {
  const struct {
    double damping;
    Method method;
    double momentum;  // [kg m/s], of some 1 kg m/s that beams and hub have each
  } cases[] = {{0.0, Method::kProjected, 1e-12},
               {2e-4, Method::kProjected, 1e-12},
               {2e-4, Method::kAuto, 1e-8}};
  for (const auto& [damping, method, momentum] : cases) {
    const Model model = Compile(Deployment("clearance", 4, damping));
    Books books(model);
    SimulateOptions options;
    options.rtol = 1e-8;
    options.method = method;
    ASSERT_TRUE(Simulate(model, options, &books).Usable());
    const double energy = books.observables.energy_at_start();  // 7.0 J
    EXPECT_LT(books.momentum, momentum);
    EXPECT_LT(books.angular, 1e-7);
    // Hub and beams: the centre of all mass does not move.
    EXPECT_LT(books.centre, 0.1 * momentum);
    // Some 2e5 steps of 1e-8 each, mostly of either sign; the loss is ten thousand times as much.
    EXPECT_LT(books.energy, 1e-5 * energy);
    EXPECT_GT(books.last_lost, 0.1 * energy);
    EXPECT_GT(books.least_lost, -1e-5 * energy);  // dissipation only grows
    EXPECT_LT(books.drift, 1e-8);
  }
}

// The hub's drift beside the beams' momentum: 36 kg of hub against 2.878 kg of the rest.
TEST(DeploymentBalance, HubMovesAgainstTheArms) {
  const Model model = Compile(Deployment("clearance", 4));
  struct Hub : Observer {
    explicit Hub(const Model& m) : observables(m) {
      for (const auto& q : observables.quantities()) names.push_back(q.name);
    }
    double At(const std::vector<double>& row, const std::string& name) const {
      return row[std::find(names.begin(), names.end(), name) - names.begin()];
    }
    void OnSample(double t, double* y, const std::vector<LatchMode>& modes) override {
      const std::vector<double>& row = observables.Row(t, y, modes);
      double p = 36.0 * At(row, "hub.vy"), rest = 0.0;
      for (int j = 1; j <= 4; ++j) {
        for (const char* half : {"_in", "_out"}) {
          rest += 0.153 * At(row, "joint" + std::to_string(j) + half + ".vy");
        }
        rest += (j < 4 ? 0.424 : 0.382) * At(row, "beam" + std::to_string(j) + ".vy");
      }
      worst = std::max(worst, std::fabs(p + rest));
      largest = std::max(largest, std::fabs(p));
    }
    Observables observables;
    std::vector<std::string> names;
    double worst = 0.0, largest = 0.0;
  };
  Hub hub(model);
  SimulateOptions options;
  options.duration = 2.0;
  ASSERT_TRUE(Simulate(model, options, &hub).Usable());
  EXPECT_GT(hub.largest, 0.5);  // [kg m/s]: the balance is not one of zeros
  EXPECT_LT(hub.worst, 1e-12);
}

// As printed, the elements' forces are no gradient: angular momentum and energy drift, by some 1e-3
// of the deployment's. The difference to the gradient form is shown, and only there.
TEST(DeploymentBalance, PrintedElementForcesDrift) {
  double drift[2];
  for (const bool gradient : {true, false}) {
    data::Scene scene = Deployment("clearance", 4);
    for (auto& beam : scene.beams) {
      beam.gradient_form = gradient;
      beam.along_chord = false;
    }
    const Model model = Compile(scene);
    Books books(model);
    SimulateOptions options;
    options.duration = 1.5;
    ASSERT_TRUE(Simulate(model, options, &books).Usable());
    drift[gradient ? 0 : 1] = books.angular;
  }
  EXPECT_LT(drift[0], 1e-6);
  EXPECT_GT(drift[1], 1e-4);
}

double WorstDistance(const MarkTracks& a, const MarkTracks& b) {
  double worst = 0.0;
  for (std::size_t m = 0; m < a.x.size(); ++m) {
    for (std::size_t i = 0; i < a.t.size(); ++i) {
      worst = std::max(worst, std::hypot(a.x[m][i] - b.x[m][i], a.y[m][i] - b.y[m][i]));
    }
  }
  return worst;
}

// Up to 0.6 s, before the first latch.
constexpr double kBeforeLatch = 0.6;

TEST(DeploymentConvergence, InTheTolerance) {
  const Model model = Compile(Deployment("suspension", 8));
  SimulateOptions options;
  options.duration = kBeforeLatch;
  options.rtol = 1e-12;
  const MarkTracks reference = SimulateMarks(model, options);
  ASSERT_EQ(reference.report.Count(EventKind::kLatch), 0);
  for (const double rtol : {1e-5, 1e-7, 1e-9}) {
    options.rtol = rtol;
    // Marks move about a metre; the error is within ten times the tolerance.
    EXPECT_LT(WorstDistance(SimulateMarks(model, options), reference), 10 * rtol);
  }
}

// The springs' sudden release rings every mode; undamped, the phases of the highest ones spoil the
// order in the largest difference (1.0 to 1.4 is seen), so the beams are damped here.
TEST(DeploymentConvergence, SecondOrderInTheSegments) {
  constexpr double kDamping = 5e-5;  // [s]
  std::vector<MarkTracks> at;
  for (const int segments : {6, 12, 24}) {
    SimulateOptions options;
    options.duration = kBeforeLatch;
    options.rtol = 1e-7;
    at.push_back(SimulateMarks(Compile(Deployment("suspension", segments, kDamping)), options));
  }
  // Differences of successive meshes shrink fourfold.
  constexpr double kLow = 1.8, kHigh = 2.2;
  const double order = std::log2(WorstDistance(at[0], at[1]) / WorstDistance(at[1], at[2]));
  EXPECT_GT(order, kLow);
  EXPECT_LT(order, kHigh);
}

}  // namespace
}  // namespace unfurl::sim::deployment_test
