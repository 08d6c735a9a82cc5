// `unfurl modes` as a person uses it.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tests/cli/program.h"

namespace unfurl::cli::modes_test {
namespace {

using ::testing::HasSubstr;

class Modes : public ProgramTest {
 protected:
  // A straight cantilever without gravity, EI = 100, m = L = 1.
  static std::string Cantilever() {
    return "[scene]\nname = 'cantilever'\nduration = 1.0\n"
           "[beam.rod]\nlength = 1.0\nmass = 1.0\nEI = 100.0\nsegments = 16\ndamping = 1e-4\n"
           "[weld.clamp]\ninner = 'ground'\nouter = 'rod.start'\n[mark.tip]\non = 'rod.end'\n";
  }
};

TEST_F(Modes, OfACantilever) {
  Put("scene.toml", Cantilever());
  const Outcome outcome =
      Run({"modes", "scene.toml", "--count", "3", "-o", "shapes.csv", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto modes = nlohmann::json::parse(outcome.out)["modes"];
  ASSERT_EQ(modes.size(), 3u);
  // Roots of 1 + cos cosh = 0; 16 segments leave (l^2 / 24) int(v v'') / int(v^2), 0.03 to 0.7%.
  constexpr double kRoots[] = {1.8751040687, 4.6940911330, 7.8547574382};
  constexpr double kLeft[] = {5e-4, 4e-3, 1e-2};
  for (int k = 0; k < 3; ++k) {
    const double omega = kRoots[k] * kRoots[k] * 10.0;
    const double found = 2.0 * std::numbers::pi * modes[k]["frequency"].get<double>();
    EXPECT_NEAR(found, omega, kLeft[k] * omega);
    // Kelvin-Voigt: beta omega / 2, whatever the mesh.
    EXPECT_NEAR(modes[k]["damping"].get<double>(), 0.5 * 1e-4 * found, 1e-6 * found * 1e-4);
  }
  EXPECT_THAT(Get("shapes.csv"), HasSubstr("tip"));
}

// What is wrong of a mode is stated, of segments and of shapes, up to modes that no mesh here has:
// within 0.5 and 4 of what it is, against the roots.
TEST_F(Modes, StatesWhatTheMeshLeavesWrong) {
  constexpr double kAllRoots[] = {1.87510406871, 4.69409113297, 7.85475743824, 10.9955407349,
                                  14.1371683910};
  Put("scene.toml", Cantilever());
  for (const char* mesh : {"beam.rod.segments=8", "beam.rod.segments=20",
                           "beam.rod.model=\"kirchhoff\"", "beam.rod.order=1"}) {
    std::vector<std::string> arguments = {"modes", "scene.toml", "--count", "5", "--json"};
    if (std::string(mesh) == "beam.rod.order=1") {
      arguments.insert(arguments.end(), {"--set", "beam.rod.model=\"kirchhoff\""});
    }
    arguments.insert(arguments.end(), {"--set", mesh});
    const Outcome outcome = Run(arguments);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto modes = nlohmann::json::parse(outcome.out)["modes"];
    for (std::size_t k = 0; k < modes.size(); ++k) {
      const double truth = kAllRoots[k] * kAllRoots[k] * 10.0 / (2.0 * std::numbers::pi);
      const double off = std::fabs(modes[k]["frequency"].get<double>() - truth);
      const double stated = modes[k]["mesh_error"].get<double>();
      if (off < 1e-6 * truth) continue;  // the roots' digits
      EXPECT_GT(stated, 0.5 * off) << mesh << " " << k;
      EXPECT_LT(stated, 4.0 * off) << mesh << " " << k;
    }
  }
  const Outcome without = Run({"modes", "scene.toml", "--no-mesh-error", "--json"});
  EXPECT_TRUE(nlohmann::json::parse(without.out)["modes"][0]["mesh_error"].is_null());
}

// A stiff beam that hangs on next to nothing is not called rigid
// without saying what may hide there.
TEST_F(Modes, SaysBelowWhichFrequencyRoundingHides) {
  Put("scene.toml",
      "[scene]\nname = 'soft'\nduration = 1.0\n"
      "[beam.rod]\nlength = 0.1\nmass = 0.001\nEI = 1e4\nsegments = 8\n"
      "[joint.j]\ninner = 'ground'\nouter = 'rod.start'\n"
      "[joint.j.spring]\nstiffness = 1e-9\npreload = 0.0\n");
  const Outcome outcome = Run({"modes", "scene.toml", "--count", "2", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  const double soft = std::sqrt(1e-9 / (0.001 * 0.1 * 0.1 / 3.0)) / (2.0 * std::numbers::pi);
  EXPECT_EQ(json["rigid_motions"].get<int>(), 1);
  EXPECT_GT(json["rigid_below"].get<double>(), soft);
  EXPECT_THAT(Run({"modes", "scene.toml"}).out, HasSubstr("or slower than"));
}

TEST_F(Modes, BadInput) {
  Put("scene.toml", Cantilever());
  const std::vector<std::string> before = {"scene.toml"};
  ExpectRefused(Run({"modes", "scene.toml", "--state", "folded"}), {"state", "folded", "drawn"},
                before);
  ExpectRefused(Run({"modes", "scene.toml", "--count", "0"}), {"count", "use 1 to"}, before);
  ExpectRefused(Run({"modes", "scene.toml", "--at", "-1"}), {"at"}, before);
  ExpectRefused(Run({"modes", "nowhere.toml"}), {"nowhere.toml"}, before);
}

}  // namespace
}  // namespace unfurl::cli::modes_test
