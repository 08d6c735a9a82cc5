// The main job on half of the trial and of the segments; main_job_slow_test.cc runs the whole, with
// many seeds.
#include "tests/cli/main_job.h"

#include <gmock/gmock.h>

namespace unfurl::cli::main_job_test {
namespace {

using ::testing::HasSubstr;

constexpr double kMarksRms = 1e-3;       // issue: marks within 1 mm RMS of truth [m]
constexpr double kStandardErrors = 3.0;  // from the truth, at most
constexpr double kResidual = 60.0;       // RMS, in sigmas of the marks, at most
constexpr double kRelativeError = 0.10;  // standard error over value, at most

TEST_F(MainJobTest, FromSceneToParametersAndPages) {
  JobSettings settings;
  settings.segments = 12;
  settings.study = StudyOnFourSegments();
  settings.duration = 2.5;
  settings.clearance = 0.0057;
  settings.damping = 1.9e-4;
  JobResult result;
  RunJob(settings, &result);
  if (HasFailure()) return;
  EXPECT_LT(result.marks_rms, kMarksRms);
  const auto [clearance, clearance_sigma] = result.Estimate("clearance");
  EXPECT_LT(std::abs(clearance - settings.clearance), kStandardErrors * clearance_sigma);
  EXPECT_LT(clearance_sigma, kRelativeError * clearance);
  const auto [damping, damping_sigma] = result.Estimate("damping");
  EXPECT_LT(std::abs(damping - settings.damping), kStandardErrors * damping_sigma);
  EXPECT_LT(damping_sigma, kRelativeError * damping);
  // The mesh's error is some thirty sigmas here. Whitened as if it were noise, it would let frame
  // and calibration drift by thousands.
  const double chi2 = result.fit.at("checks").at("chi2_per_dof [1]");
  EXPECT_LT(chi2, kResidual * kResidual);

  // What a user does next: look at every file, and hold the drawing beside the trial.
  Good({"simulate", Shipped("scene_suspension.toml"), "-o", "drawn.h5", "--quiet"});
  const Outcome correlated =
      Good({"correlate", "tracks.h5", "drawn.h5", "--report", "page.html", "--json"});
  EXPECT_FALSE(nlohmann::json::parse(correlated.out, nullptr, false).is_discarded());
  EXPECT_THAT(Get("page.html"), HasSubstr("</html>"));
  EXPECT_THAT(Get("fit.html"), HasSubstr("</html>"));
  for (const char* file :
       {"truth_run.h5", "survey.h5", "trial.h5", "rig.h5", "tracks.h5", "fit.h5", "drawn.h5"}) {
    const Outcome info = Good({"info", file});
    EXPECT_THAT(info.out, HasSubstr("made by   unfurl"));
    EXPECT_FALSE(
        nlohmann::json::parse(Good({"info", file, "--json"}).out, nullptr, false).is_discarded());
  }
  for (const char* file : {"scene_suspension.toml", "lab.toml", "points.csv", "study.toml"}) {
    EXPECT_THAT(Good({"info", Shipped(file)}).out, HasSubstr(file));
  }
  Good({"convert", "drawn.h5", "drawn.csv"});
  EXPECT_THAT(Get("drawn.csv"), HasSubstr("hub.x [m]"));
  Good({"convert", "tracks.h5", "tracks.csv"});
  Good({"convert", "survey.h5", "survey.csv"});
}

TEST_F(MainJobTest, TheSameInputsGiveTheSameBytes) {
  for (const char* run : {"a", "b"}) {
    const std::string name = run;
    Good({"simulate", Shipped("scene_suspension.toml"), "--duration", "0.2", "-o", "run.h5"});
    Good({"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "trial.h5"});
    std::filesystem::rename(folder_ / "run.h5", folder_ / (name + "_run.h5"));
    std::filesystem::rename(folder_ / "trial.h5", folder_ / (name + "_trial.h5"));
  }
  EXPECT_TRUE(Get("a_run.h5") == Get("b_run.h5"));
  EXPECT_TRUE(Get("a_trial.h5") == Get("b_trial.h5"));
}

TEST_F(MainJobTest, EveryVerbHasHelpWithAnExample) {
  for (const char* verb :
       {"simulate", "expose", "calibrate", "reconstruct", "correlate", "fit", "info", "convert"}) {
    EXPECT_THAT(Good({verb, "--help"}).out, HasSubstr("Example:")) << verb;
  }
  EXPECT_THAT(Good({"--help"}).out, HasSubstr("Exit codes"));
  EXPECT_THAT(Good({"--version"}).out, ::testing::StartsWith("unfurl "));
}

TEST_F(MainJobTest, QuietSaysNothing) {
  EXPECT_EQ(Good({"simulate", Shipped("scene_clearance.toml"), "--duration", "0.05", "--quiet",
                  "-o", "run.h5"})
                .out,
            "");
}

}  // namespace
}  // namespace unfurl::cli::main_job_test
