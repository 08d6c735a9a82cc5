// The ladder of a fit through the real program.
#include <fmt/format.h>

#include "tests/cli/fit_cases.h"
#include "tests/source_dir.h"

namespace unfurl::cli::fit_ladder_test {
namespace {

constexpr char kTrial[] = "[trial]\ntracks = \"tracks.h5\"\nwindow = [0.0, 0.8]\n";

TEST_F(FitVerbTest, TheOldCheckOfTheMeshIsRefusedWithItsRemedy) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml", kTrial, "[mesh_check]\nwanted = false\n");
  ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {"mesh_check", "fidelity.segments"},
                Files());
}

// Killed at random moments of the climb, and resumed with other numbers of workers: the same bytes.
TEST_F(FitVerbTest, AKillOnTheLadderLosesNothing) {
  const std::string scene = std::string(UNFURL_SOURCE_DIR) + "/tests/correlate/flexible_arm.toml";
  Good({"simulate", scene, "--duration", "0.6", "-o", "truth.h5", "--quiet", "--set",
        "beam.arm.segments=6"});
  NoisyTracks("tracks.h5", 5, 2e-4);
  Put("study.toml", fmt::format(R"([study]
scene = "{}"
[trial]
tracks = "tracks.h5"
[parameter.damping]
keys = ["beam.arm.damping"]
start = 2.2e-4
bounds = [1e-5, 2e-3]
transform = "log"
[parameter.stiffness]
keys = ["joint.hinge.spring.stiffness"]
start = 0.21
bounds = [0.1, 0.4]
[fidelity]
segments = [2, 3, 4]
[profile]
levels = []
)",
                                scene));
  ExpectResumesOf("study.toml", 3, 2);
}

}  // namespace
}  // namespace unfurl::cli::fit_ladder_test
