// Mechanisms through states in which the coordinates that describe them best are others than
// before.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "data/scene.h"
#include "sim/methods/simulate.h"
#include "sim/model/model.h"

namespace unfurl::sim::dead_centre_test {
namespace {

// A slider-crank that turns freely, without gravity: crank of length 0.15 and inertia `J` about its
// pin, rod of 0.3.
std::string SliderCrank() {
  return "[scene]\nname = \"slider-crank\"\nduration = 2.0\n"
         "[body.crank]\nmass = 1.0\ninertia = 0.02\n"
         "[body.rod]\nmass = 0.3\ninertia = 0.00225\n"
         "[body.slider]\nmass = 0.5\ninertia = 0.001\n"
         "[joint.main]\ninner = \"ground\"\nouter = \"crank\"\ntheta_rate = 20.0\n"
         "[joint.crank_pin]\ninner = \"crank\"\ninner_point = [0.15, 0.0]\nouter = \"rod\"\n"
         "outer_point = [-0.15, 0.0]\n"
         "[joint.wrist]\ninner = \"rod\"\ninner_point = [0.15, 0.0]\nouter = \"slider\"\n"
         "[joint.guide]\ntype = \"slider\"\ninner = \"ground\"\nouter = \"slider\"\ntravel = 0.45\n"
         "[mark.pin]\non = \"crank\"\npoint = [0.15, 0.0]\n"
         "[mark.end]\non = \"slider\"\n";
}

// Success: the slider is where the crank's angle puts it, 0.15 cos + sqrt(0.09 - (0.15 sin)^2), and
// the energy, a function of angle and rate alone, is what it was, within a hundred tolerances.
TEST(DeadCentre, OfTheSliderCrankIsPassedByEveryMethod) {
  const Model model = Compile(data::ParseScene(SliderCrank(), "slider_crank.toml"));
  for (const Method method : {Method::kProjected, Method::kPartitioned}) {
    for (const double rtol : {1e-5, 1e-8}) {
      SimulateOptions options;
      options.method = method;
      options.rtol = rtol;
      const MarkTracks t = SimulateMarks(model, options);
      ASSERT_TRUE(t.report.Usable()) << t.report.message;
      double off = 0.0, energy_off = 0.0, turned = 0.0, energy_at_start = 0.0;
      for (std::size_t k = 0; k < t.t.size(); ++k) {
        const double x = t.x[0][k], y = t.y[0][k];
        off = std::max(off, std::fabs(t.x[1][k] - x - std::sqrt(0.09 - y * y)));
        const double rate = (x * t.vy[0][k] - y * t.vx[0][k]) / (x * x + y * y);
        const double vs = t.vx[1][k], rod_rate = -t.vy[0][k] / (t.x[1][k] - x);
        const double vcx = 0.5 * (t.vx[0][k] + vs), vcy = 0.5 * t.vy[0][k];
        const double energy = 0.5 * 0.02 * rate * rate + 0.5 * 0.3 * (vcx * vcx + vcy * vcy) +
                              0.5 * 0.00225 * rod_rate * rod_rate + 0.5 * 0.5 * vs * vs;
        if (k == 0) energy_at_start = energy;
        energy_off = std::max(energy_off, std::fabs(energy - energy_at_start));
        turned += rate * 1e-3;
      }
      EXPECT_GT(turned, 3 * M_PI);
      EXPECT_LT(off, 10 * rtol) << MethodName(method);
      EXPECT_LT(energy_off, 100 * rtol * energy_at_start) << MethodName(method);
    }
  }
}

// Eight bars folded onto one another, each pin on the pin before the last, fall under gravity.
// Success: both methods agree within fifty tolerances of the looser.
TEST(DeadCentre, AFoldedChainFalls) {
  std::string text = "[scene]\nname = \"folded chain\"\nduration = 0.6\n";
  constexpr int kBars = 8;
  for (int k = 0; k < kBars; ++k) {
    text += fmt::format("[body.b{}]\nmass = 1.0\ninertia = 0.0833\n", k);
    text += fmt::format(
        "[joint.j{}]\ninner = \"{}\"\n{}outer = \"b{}\"\nouter_point = [-0.5, 0.0]\ntheta = {}\n",
        k, k == 0 ? "ground" : fmt::format("b{}", k - 1),
        k == 0 ? "" : "inner_point = [0.5, 0.0]\n", k, k == 0 ? 0.0 : M_PI);
  }
  text += "[gravity]\nacceleration = [0.0, -9.81]\n[mark.tip]\non = \"b7\"\npoint = [0.5, 0.0]\n";
  const Model model = Compile(data::ParseScene(text, "folded.toml"));
  SimulateOptions options;
  options.rtol = 1e-11;
  const MarkTracks projected = SimulateMarks(model, options);
  options.rtol = 1e-8;
  options.method = Method::kPartitioned;
  const MarkTracks partitioned = SimulateMarks(model, options);
  ASSERT_TRUE(projected.report.Usable() && partitioned.report.Usable());
  ASSERT_EQ(projected.t.size(), partitioned.t.size());
  double worst = 0.0;
  for (std::size_t k = 0; k < projected.t.size(); ++k) {
    worst = std::max(worst, std::hypot(projected.x[0][k] - partitioned.x[0][k],
                                       projected.y[0][k] - partitioned.y[0][k]));
  }
  EXPECT_LT(worst, 50 * options.rtol);
  EXPECT_GT(std::fabs(projected.y[0].back() - projected.y[0].front()), 0.1);  // it did fall
}

}  // namespace
}  // namespace unfurl::sim::dead_centre_test
