// Smooth beams in whole models.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "base/error.h"
#include "runs.h"
#include "scenes.h"
#include "sim/dynamics/observables.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim::kirchhoff_scene_test {
namespace {

// "segments = 12" or "model = ...".
std::string Smooth(int modes) { return fmt::format("model = \"kirchhoff\"\norder = {}", modes); }
std::string Segments(int n) { return fmt::format("segments = {}", n); }

// Two beams pinned in series to the ground, folded, with springs on their own ends.
std::string TwoBeams(const std::string& model, const std::string& more = {}) {
  std::string text = "[scene]\nname = \"two beams\"\nduration = 0.2\n";
  for (const char* name : {"beam1", "beam2"}) {
    text += fmt::format("[beam.{}]\nlength = 0.8\nmass = 0.424\nEI = 18.69\n{}\n{}\n", name, model,
                        more);
  }
  return text +
         "[joint.root]\ninner = \"ground\"\nouter = \"beam1.start\"\ntheta = 1.5707963267948966\n"
         "[joint.root.spring]\nstiffness = 0.218\npreload = 1.57\n"
         "[joint.knee]\ninner = \"beam1.end\"\nouter = \"beam2.start\"\nsign = -1\n"
         "theta = 3.141592653589793\n"
         "[joint.knee.spring]\nstiffness = 0.218\npreload = 1.57\n"
         "[mark.tip]\non = \"beam2.end\"\n[mark.middle]\non = \"beam1\"\nat = 0.5\n";
}

MarkTracks Tracks(const std::string& scene, double rtol, double duration = 0.0) {
  SimulateOptions options;
  options.rtol = rtol;
  options.duration = duration;
  MarkTracks tracks = SimulateMarks(ModelFrom(scene), options);
  EXPECT_TRUE(tracks.report.Usable()) << tracks.report.message;
  return tracks;
}

// Two formulations that share no equation of a beam. The segments come towards the smooth beam with
// the square of their number, from both sides of that order.
TEST(SmoothBeams, SegmentsConvergeToThem) {
  // Undamped, the release of the springs rings every mode of the mesh, and the largest difference
  // is that of their phases.
  const std::string damping = "damping = 2e-4";
  const MarkTracks smooth = Tracks(TwoBeams(Smooth(5), damping), 1e-9);
  const MarkTracks few = Tracks(TwoBeams(Segments(10), damping), 1e-7);
  const MarkTracks many = Tracks(TwoBeams(Segments(20), damping), 1e-7);
  for (const std::size_t mark : {0U, 1U}) {
    const double ratio = FarthestApart(few, smooth, mark) / FarthestApart(many, smooth, mark);
    EXPECT_GT(ratio, 3.2) << mark;  // 4 when nothing but the n^-2 of the elements is left
    EXPECT_LT(ratio, 8.0) << mark;  // 8 were it all the n^-3 of the bodies at the ends
  }
  // The tip has gone a sixth of a metre.
  EXPECT_LT(FarthestApart(many, smooth, 0), 5e-4);
}

TEST(SmoothBeams, KeepEnergyAndReportWhatDampingTakes) {
  for (const char* damping : {"", "damping = 2e-4"}) {
    const Model model = ModelFrom(TwoBeams(Smooth(3), damping));
    struct Watch : Observer {
      explicit Watch(const Model& m) : dynamics(m) {}
      void OnSample(double t, double* y, const std::vector<LatchMode>&) override {
        const Balance b = dynamics.BalanceAt(t, y);
        if (t == 0.0) first = b;
        worst = std::max(worst, std::fabs(b.Conserved() - first.Conserved()));
        bending = std::max(bending, b.bending);
        last = b;
      }
      Dynamics dynamics;
      Balance first, last;
      double worst = 0.0, bending = 0.0;
    } watch(model);
    SimulateOptions options;
    options.rtol = 1e-11;
    EXPECT_TRUE(Simulate(model, options, &watch).Usable());
    EXPECT_LT(watch.worst, 1e-9 * watch.first.effects[EffectIndex<JointEffect<Spring>>()])
        << damping;
    EXPECT_GT(watch.bending, 1e-4);
    EXPECT_EQ(watch.last.dissipated_beams > 1e-6, *damping != '\0');
  }
}

// A body at a beam's end is part of the beam. Held there by the constraints of a driven joint
// instead, it must move alike.
TEST(SmoothBeams, CarriedBodyMovesAsAConstrainedOne) {
  const auto scene = [](const char* hold) {
    return "[scene]\nname = \"carried\"\nduration = 0.15\n"
           "[beam.rod]\nlength = 0.8\nmass = 0.4\nEI = 3.0\n" +
           Smooth(2) +
           "\n[body.tip]\nmass = 0.3\ninertia = 2e-3\n"
           "[joint.root]\ninner = \"ground\"\nouter = \"rod.start\"\ntheta = 0.3\ntheta_rate = "
           "4.0\n"
           "[joint.root.spring]\nstiffness = 2.0\npreload = 1.0\n" +
           std::string(hold) +
           "[gravity]\nacceleration = [0.0, -9.81]\n"
           "[mark.corner]\non = \"tip\"\npoint = [0.1, 0.0]\n"
           "[mark.end]\non = \"rod.end\"\n";
  };
  const std::string points = "inner = \"rod.end\"\nouter = \"tip\"\nouter_point = [-0.07, 0.02]\n";
  const MarkTracks carried = Tracks(scene(("[weld.w]\nangle = 0.4\n" + points).c_str()), 1e-10);
  const MarkTracks held = Tracks(
      scene(
          ("[joint.j]\nzero_angle = 0.4\n" + points + "[joint.j.drive]\nposition = 0.0\n").c_str()),
      1e-10);
  constexpr double kTolerance = 1e-8;  // [m], of a path of half a metre at rtol 1e-10
  for (const std::size_t mark : {0U, 1U}) EXPECT_LT(FarthestApart(carried, held, mark), kTolerance);
}

// Welds that stay constraints: to the ground, and of two beams. A cantilever of two halves in
// gravity that sets in at t = 0 follows the sum of its modes.
TEST(SmoothBeams, WeldedHalvesSwingAsOneCantilever) {
  constexpr double kGravity = 1e-3;  // small against stiffness: linear to 1e-8
  std::string text = "[scene]\nname = \"halves\"\nduration = 1.0\n";
  for (const char* name : {"a", "b"}) {
    text += fmt::format("[beam.{}]\nlength = 0.5\nmass = 0.5\nEI = 10.0\n{}\n", name, Smooth(3));
  }
  text += fmt::format(
      "[weld.root]\ninner = \"ground\"\nouter = \"a.start\"\n"
      "[weld.middle]\ninner = \"a.end\"\nouter = \"b.start\"\n"
      "[gravity]\nacceleration = [0.0, {}]\n[mark.tip]\non = \"b.end\"\n",
      -kGravity);
  const MarkTracks tracks = Tracks(text, 1e-12);
  constexpr double kRoots[4] = {1.875104068711961, 4.694091132974175, 7.854757438237612,
                                10.99554073487547};
  double worst = 0.0;
  for (std::size_t i = 0; i < tracks.t.size(); ++i) {
    double sum = 0.0;
    for (const double b : kRoots) {
      // The shape has a mean square of one and a mean of 2 sigma / b.
      const double sigma = (std::sinh(b) - std::sin(b)) / (std::cosh(b) + std::cos(b));
      const double omega = b * b * std::sqrt(10.0);
      const double tip = std::cosh(b) - std::cos(b) - sigma * (std::sinh(b) - std::sin(b));
      sum -= tip * 2.0 * sigma / b * kGravity / (omega * omega) *
             (1.0 - std::cos(omega * tracks.t[i]));
    }
    worst = std::max(worst, std::fabs(tracks.y[0][i] - sum));
  }
  const double scale = kGravity / 80.0;  // m g L^3 / (8 EI)
  EXPECT_LT(worst, 1e-3 * scale);        // the fifth mode's share is 2e-4
}

TEST(SmoothBeams, WatchedMarkIsFoundWhereItsTrackCrosses) {
  const std::string scene = TwoBeams(Smooth(3)) +
                            "[event.half]\nwhen = \"middle.x\"\nlevel = 0.005\n"
                            "direction = \"rising\"\n";
  SimulateOptions options;
  options.rtol = 1e-9;
  options.rate = 1e5;
  const MarkTracks tracks = SimulateMarks(ModelFrom(scene), options);
  ASSERT_EQ(tracks.report.events.size(), 1u);
  const double t = tracks.report.events[0].t;
  const std::size_t i = static_cast<std::size_t>(t * options.rate);
  EXPECT_LE(tracks.x[1][i], 0.005);
  EXPECT_GE(tracks.x[1][i + 1], 0.005);
}

TEST(SmoothBeams, WhatTheyCannotDoIsSaid) {
  EXPECT_THROW(ModelFrom(TwoBeams(Smooth(12))), Error);
  EXPECT_THROW(ModelFrom(TwoBeams(Smooth(0))), Error);
}

TEST(SmoothBeams, EffectsAndBodiesAreNamed) {
  const Model model = ModelFrom(TwoBeams(Smooth(3)));
  EXPECT_EQ(model.DynamicBodies(), 2);
  const KirchhoffBeams::Beam& beam = model.kirchhoff.beam(1);
  EXPECT_EQ(NameOfRigidBody(model, beam.root), "beam 'beam2'");
  EXPECT_EQ(NameOfRigidBody(model, beam.first_amplitude() + 1), "beam 'beam2', amplitudes from 4");
}

}  // namespace
}  // namespace unfurl::sim::kirchhoff_scene_test
