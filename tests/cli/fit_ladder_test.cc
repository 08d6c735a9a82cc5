// The ladder of a fit through the real program.
#include "tests/cli/fit_cases.h"

namespace unfurl::cli {
namespace {

constexpr char kTrial[] = "[trial]\ntracks = \"tracks.h5\"\nwindow = [0.0, 0.8]\n";

TEST_F(FitVerbTest, TheOldCheckOfTheMeshIsRefusedWithItsRemedy) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml", kTrial, "[mesh_check]\nwanted = false\n");
  ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5"}), {"mesh_check", "fidelity.segments"},
                Files());
}

}  // namespace
}  // namespace unfurl::cli
