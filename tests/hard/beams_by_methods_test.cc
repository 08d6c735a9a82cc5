// Every model of a beam by every method, alone and in a closed loop: it works, or is judged.
#include <gtest/gtest.h>

#include "sim/methods/simulate.h"
#include "tests/hard/run_of.h"
#include "tests/sim/scenes.h"

namespace unfurl::sim::beams_by_methods_test {
namespace {

struct BeamModel {
  const char* name;
  const char* keys;
  bool stretches = false;
};
constexpr BeamModel kModels[] = {
    {"chord", "segments = 4\n"},
    {"gradient", "segments = 4\nform = \"gradient\"\n"},
    {"printed", "segments = 4\nform = \"printed\"\n"},
    {"stretching", "segments = 4\naxial = \"elastic\"\nEA = 1e5\n", true},
    {"damped", "segments = 4\ndamping = 1e-4\n"},
    {"smooth", "model = \"kirchhoff\"\norder = 2\n"},
    {"smooth, damped", "model = \"kirchhoff\"\norder = 2\ndamping = 1e-4\n"},
    {"smooth, stretching", "model = \"kirchhoff\"\naxial = \"elastic\"\nEA = 1e5\n", true},
};

// A rod of 1 m that swings under gravity: from a pin, or as the coupler of a four-bar chain.
std::string Scene(const BeamModel& model, bool loop) {
  std::string text =
      "[scene]\nname = \"rod\"\nduration = 0.3\n[gravity]\nacceleration = [0.0, -9.81]\n"
      "[mark.tip]\non = \"rod.end\"\n"
      "[joint.a]\ninner = \"ground\"\nouter = \"rod.start\"\ntheta = 0.1\n"
      "[beam.rod]\nlength = 1.0\nmass = 0.5\nEI = 20.0\n";
  text += model.keys;
  if (loop) {
    text +=
        "[body.bar]\nmass = 0.2\ninertia = 0.01\n"
        "[joint.b]\ninner = \"rod.end\"\nouter = \"bar\"\nouter_point = [-0.25, 0.0]\n"
        "theta = -1.2\n"
        "[joint.c]\ninner = \"ground\"\ninner_point = [1.3, -0.3]\nouter = \"bar\"\n"
        "outer_point = [0.25, 0.0]\n";
  }
  return text;
}

// Against 8(5,3) at a tolerance ten thousand times tighter: ten tolerances, as docs/accuracy.md
// promises, in the scene's size of 1 m.
void Check(const BeamModel& beam, bool loop, Method method) {
  SCOPED_TRACE(fmt::format("{}{} by {}", beam.name, loop ? ", loop" : "", MethodName(method)));
  constexpr double kRtol = 1e-5, kTight = 1e-9, kAllowed = 10.0 * kRtol;
  const std::string toml = Scene(beam, loop);
  const Model model = ModelFrom(toml);
  const MarkTracks run = RunOf(model, method, 0, kRtol);
  if (!run.report.Usable()) {
    // Explicit steps at the edge of stability, of vibrations along a stiff axis: judged.
    EXPECT_TRUE(beam.stretches && method != Method::kAuto && method != Method::kImplicit);
    EXPECT_NE(run.report.message.find("try method \"implicit\""), std::string::npos)
        << run.report.message;
    return;
  }
  const MarkTracks truth = RunOf(model, Method::kProjected, 8, kTight);
  ASSERT_TRUE(truth.report.Usable()) << truth.report.message;
  ASSERT_EQ(run.t.size(), truth.t.size());
  EXPECT_LT(Apart(run, truth), kAllowed);
}

TEST(BeamsByMethods, WorkOrAreJudged) {
  for (const BeamModel& beam : kModels) {
    for (const bool loop : {false, true}) {
      for (const Method method :
           {Method::kAuto, Method::kProjected, Method::kPartitioned, Method::kImplicit}) {
        Check(beam, loop, method);
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::sim::beams_by_methods_test
