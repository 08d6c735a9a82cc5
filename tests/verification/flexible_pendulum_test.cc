// The flexible pendulum of data/sets/flexible_pendulum. Source: the inextensible rod (elastica) in
// motion. Quantity: places of the middle and the tip over 2 s. Reference: the rod in eight modes of
// its angle (modal_rod.h), Fehlberg 7(8). Tolerance: second order in the segments, from both sides,
// and the level that follows. Not checked: stretching.
#include <gtest/gtest.h>

#include <cmath>

#include "modal_rod.h"
#include "reference.h"
#include "runs.h"

namespace unfurl::sim::flexible_pendulum_test {
namespace {

constexpr int kSamples = 200;

TEST(FlexiblePendulum, SegmentsConvergeToTheRodInSecondOrder) {
  constexpr int kModes = 8;
  reference::ModalRod rod(kModes, false);
  rod.length = 1.0, rod.mass = 0.5, rod.EI = 2.0;
  rod.gravity = {0.0, -9.81};
  reference::Integrator integrator;
  integrator.tolerance = 1e-9;
  const auto times = reference::EvenTimes(2.0, kSamples);
  const auto states =
      integrator.Run([&](double t, const auto& y, auto& rate) { rod.RightSide(t, y, rate); },
                     std::vector<double>(2 * kModes, 0.0), times);
  std::vector<double> error;
  for (const int n : {12, 24, 48}) {
    data::Scene scene = ReadSet("flexible_pendulum/scene.toml");
    scene.beams[0].segments = n;
    SimulateOptions options;
    options.rtol = 1e-8;
    options.rate = kSamples / 2.0;
    const Recorder run = Record(Compile(scene), options);
    const auto mx = run["middle.x"], my = run["middle.y"], tx = run["tip.x"], ty = run["tip.y"];
    double sum = 0.0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      const auto p = rod.At(times[k], states[k]);
      sum += std::norm(p.end - std::complex<double>(tx[k], ty[k])) +
             std::norm(p.middle - std::complex<double>(mx[k], my[k]));
    }
    error.push_back(std::sqrt(sum / (2.0 * static_cast<double>(times.size()))));
    std::printf("found: flexible pendulum, n = %d: RMS distance %.3e m\n", n, error.back());
  }
  for (int k = 0; k < 2; ++k) {
    const double order = std::log2(error[k] / error[k + 1]);
    std::printf("found: flexible pendulum, order %.3f\n", order);
    EXPECT_GT(order, 1.7);
    EXPECT_LT(order, 2.3);
  }
  ExpectWithin("flexible pendulum, 48 segments, middle and tip, RMS [m]", error[2], 5e-4);
}

}  // namespace
}  // namespace unfurl::sim::flexible_pendulum_test
