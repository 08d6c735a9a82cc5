// Laws that are narrow in a state variable: reversals against dry friction, snaps of tables, hard
// stops, springs that pass one another. Truth: the oscillator with Coulomb's friction in closed
// form, and Lagrange's equations of chains of bars, integrated by Boost.Odeint.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "sim/methods/simulate.h"
#include "tests/hard/narrow_scenes.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::narrow_test {
namespace {

constexpr Method kMethods[] = {Method::kAuto, Method::kProjected, Method::kPartitioned,
                               Method::kImplicit};
// Tolerances that a run may be off; and where hard stops, which turn an error within a contact of
// microseconds into one of the speed after it, hand it on (docs/accuracy.md: the bouncing latch).
constexpr double kAllowed = 10.0, kAllowedOfStops = 100.0;
// Of a range: the largest error that is magnified as a small one is [-].
constexpr double kFirstOrder = 0.05;

MarkTracks RunOf(const Model& model, Method method, double rtol) {
  SimulateOptions options;
  options.method = method;
  options.rtol = rtol;
  options.rate = 100.0;
  return SimulateMarks(model, options);
}

// Half cycles about centres that friction shifts by M / k to the side that is left.
double Oscillator(double t, double k, double inertia, double moment) {
  const double omega = std::sqrt(k / inertia), shift = moment / k, half = M_PI / omega;
  const double n = std::floor(t / half), side = std::fmod(n, 2.0) == 0.0 ? 1.0 : -1.0;
  const double reach = 1.0 - 2.0 * shift * n;  // from 1 rad on
  return side * ((reach - shift) * std::cos(omega * (t - n * half)) + shift);
}

TEST(Narrow, ReversalsAgainstDryFrictionAreSeen) {
  constexpr double kK = 10.0, kMoment = 0.05;
  for (const double creep : {1e-4, 1e-5, 1e-7}) {
    const Model model = ModelFrom(fmt::format(
        "[scene]\nname = \"oscillator\"\nduration = 10.0\n[body.wheel]\nmass = 1.0\ninertia = 1.0\n"
        "[joint.axle]\ninner = \"ground\"\nouter = \"wheel\"\ntheta = 1.0\n"
        "[joint.axle.spring]\nstiffness = {}\n[joint.axle.friction]\nmoment = {}\n"
        "creep_rate = {}\n[mark.rim]\non = \"wheel\"\npoint = [1.0, 0.0]\n",
        kK, kMoment, creep));
    for (const Method method : kMethods) {
      for (const double rtol : {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
        const MarkTracks run = RunOf(model, method, rtol);
        ASSERT_TRUE(run.report.Usable()) << run.report.message;
        double off = 0.0;
        for (std::size_t k = 0; k < run.t.size(); ++k) {
          const double theta = Oscillator(run.t[k], kK, 1.0, kMoment);
          off = std::max(off,
                         std::hypot(run.x[0][k] - std::cos(theta), run.y[0][k] - std::sin(theta)));
        }
        // Over the 1.68 m that the rim's height goes through; and what the creep band's own width
        // makes of Coulomb's law, of second order in it.
        EXPECT_LT(off, kAllowed * rtol * 1.68 + creep * creep)
            << creep << " " << MethodName(method) << " " << rtol;
      }
    }
  }
}

// UNFURL_NARROW_SCENES sets how many, from UNFURL_FIRST_SCENE on.
TEST(Narrow, RandomScenes) {
  const auto number = [](const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text != nullptr ? std::atoi(text) : otherwise;
  };
  const int count = number("UNFURL_NARROW_SCENES", 3), first = number("UNFURL_FIRST_SCENE", 1);
  int runs = 0, told = 0, kept = 0, beyond = 0, stopped = 0, far = 0;
  double of_stops = 0.0;  // tolerances
  for (int seed = first; seed < first + count; ++seed) {
    const NarrowScene scene = DrawNarrowScene(static_cast<std::uint64_t>(seed));
    const Model model = ModelFrom(scene.toml);
    for (const Method method : kMethods) {
      for (const double rtol : {1e-3, 1e-5, 1e-7}) {
        const MarkTracks run = RunOf(model, method, rtol);
        ++runs;
        if (!run.report.Usable() || !run.report.warnings.empty()) {
          ++told;
          continue;
        }
        ASSERT_GE(run.t.size(), scene.truth.x[0].size());
        const double off = PartApart({run.x, run.y}, scene.truth);
        // Where the error promised becomes a part of the range, it is no longer of first order.
        if (scene.magnifies * kAllowed * rtol > kFirstOrder) continue;
        const double tolerances = off / (rtol * std::max(1.0, scene.magnifies));
        if (!scene.contains[2]) {
          ++kept;
          beyond += tolerances > kAllowed;
        } else {
          of_stops = std::max(of_stops, tolerances);
          ++stopped;
          far += tolerances > kAllowedOfStops;
          continue;
        }
        EXPECT_LT(tolerances, 3.0 * kAllowed) << "seed " << seed << " " << MethodName(method) << " "
                                              << rtol << ", magnified " << scene.magnifies << "\n"
                                              << scene.toml;
      }
    }
  }
  fmt::print(
      "{} runs, {} told; of {} without stops {} beyond {} tolerances; with stops {:.0f} at most\n",
      runs, told, kept, beyond, kAllowed, of_stops);
  // 98% as of other scenes drawn by seed: at 1e-7 what is left of a table's knots adds up.
  EXPECT_LE(beyond, kept / 50 + 1);  // of a few runs one
  EXPECT_LE(far, stopped / 50);
  EXPECT_LE(told, runs / 20);  // a warning for everything would be no promise
}

}  // namespace
}  // namespace unfurl::sim::narrow_test
