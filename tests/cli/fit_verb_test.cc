// `unfurl fit` through the real program, on the latching pendulum.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "data/fit.h"
#include "tests/cli/fit_cases.h"
#include "tests/source_dir.h"

namespace unfurl::cli::fit_verb_test {
namespace {

using ::testing::HasSubstr;

constexpr char kOneTrial[] = "[trial]\ntracks = \"tracks.h5\"\n";

double Number(const nlohmann::json& fit, const std::string& parameter, const char* what) {
  for (const auto& p : fit.at("parameters")) {
    if (p.at("name") == parameter) return p.at(what);
  }
  return std::nan("");
}

TEST_F(FitVerbTest, AKillAtAnyMomentLosesNothing) { ExpectResumes(4, 1); }

TEST_F(FitVerbTest, WorkersDoNotChangeTheFile) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml", kOneTrial);
  Good({"fit", "study.toml", "-o", "fit.h5", "--quiet", "--workers", "1"});
  const std::string one = Get("fit.h5");
  Good({"fit", "study.toml", "-o", "fit.h5", "--quiet", "--workers", "3"});
  EXPECT_TRUE(Get("fit.h5") == one);
}

TEST_F(FitVerbTest, AJournalOfAnotherStudyIsRefused) {
  MakeTracks("tracks.h5", {}, 5);
  constexpr char kLong[] = "[solver]\nscreened = 12\nstarts = 2\n";
  MakeStudy("study.toml", kOneTrial, kLong);
  // The journal is there for most of a fit's time, so doubling does not leap over it. One that was
  // killed before its header was whole holds nothing, and would rightly be begun anew.
  constexpr std::uintmax_t kHeader = 4096;  // more than the header has [bytes]
  auto begun = [&] {
    const auto path = folder_ / "fit.h5.partial";
    return std::filesystem::exists(path) && std::filesystem::file_size(path) > kHeader;
  };
  for (int after = 100; !begun(); after *= 2) {
    ASSERT_LT(after, 60000);
    RunProgram({"fit", "study.toml", "-o", "fit.h5", "--quiet"}, folder_, 0, after, SIGKILL);
  }
  MakeStudy("study.toml", kOneTrial, kLong + std::string("[profile]\nlevels = [1.0]\n"));
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"fit", "study.toml", "-o", "fit.h5", "--resume"}),
                {"another study", "--resume"}, before);
}

// Two trials of two springs: each trial's own settings, one clearance for both.
TEST_F(FitVerbTest, SeveralTrialsWithSettingsOfTheirOwn) {
  MakeTracks("one.h5", {}, 5);
  MakeTracks("two.h5", {"joint.hinge.spring.preload=1.3"}, 6);
  MakeStudy("study.toml",
            "[[trial]]\nname = \"first\"\ntracks = \"one.h5\"\n[[trial]]\nname = \"weak\"\n"
            "tracks = \"two.h5\"\nset = [\"joint.hinge.spring.preload=1.3\"]\nmarks = [\"tip\"]\n");
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("single.toml", kOneTrial);
  const auto both = nlohmann::json::parse(
      Good({"fit", "study.toml", "-o", "fit.h5", "--json", "--report", "fit.html"}).out);
  const auto single =
      nlohmann::json::parse(Good({"fit", "single.toml", "-o", "single.h5", "--json"}).out);
  EXPECT_LT(Number(both, "stiffness", "sigma_white"), Number(single, "stiffness", "sigma_white"));
  EXPECT_NEAR(Number(both, "stiffness", "value"), 0.218, 4.0 * Number(both, "stiffness", "sigma"));
  const data::FitRecord record = data::ReadFit((folder_ / "fit.h5").string());
  EXPECT_THAT(record.trials, ::testing::ElementsAre("first", "weak"));
  EXPECT_EQ(record.trial.front(), 0);
  EXPECT_EQ(record.trial.back(), 1);
  EXPECT_GT(record.band.norm(), 0.0);
  EXPECT_THAT(Get("fit.html"), HasSubstr("weak"));
}

// Someone's own program in place of the simulator: here a script that runs ours. Up to a time by
// which the bounces have not yet made the motion answer to every digit: there the program, which
// gives no runs of less error of its own, has the same weights as the scene. Its steps of
// differences are others, since it states no noise of its own: half a standard error is allowed
// (0.42 of clearance and 0.15 of stiffness measured).
TEST_F(FitVerbTest, AProgramAsTheModel) {
  constexpr char kWindow[] = "window = [0.0, 0.8]\n";
  MakeTracks("tracks.h5", {}, 5);
  Put("model.sh", fmt::format("set -e\n'{}' simulate '{}/data/sets/bouncing_latch/scene.toml' "
                              "--duration 0.9 --rate 2000 --rtol 1e-6 --quiet -o run.h5 "
                              "--set mark.mid.on=arm --set 'mark.mid.point=[0.0, 0.0]' "
                              "--set joint.hinge.latch.theta_a={{{{clearance}}}} "
                              "--set joint.hinge.latch.theta_b={{{{clearance}}}} "
                              "--set joint.hinge.spring.stiffness={{{{stiffness}}}}\n",
                              UNFURL_PROGRAM, UNFURL_SOURCE_DIR));
  Put("program.toml", std::string(R"([study]
name = "by a program"
[trial]
tracks = "tracks.h5"
)") + kWindow + R"([model]
command = ["sh", "model.sh"]
files = ["model.sh"]
tracks = "run.h5"
[parameter.clearance]
start = 0.0055
bounds = [0.002, 0.02]
transform = "log"
[parameter.stiffness]
start = 0.21
bounds = [0.1, 0.4]
[profile]
levels = []
)");
  MakeStudy("study.toml", kOneTrial + std::string(kWindow), "[profile]\nlevels = []\n");
  const auto program = nlohmann::json::parse(
      Good({"fit", "program.toml", "-o", "a.h5", "--json", "--allow-programs"}).out);
  const auto scene = nlohmann::json::parse(Good({"fit", "study.toml", "-o", "b.h5", "--json"}).out);
  for (const char* name : {"clearance", "stiffness"}) {
    EXPECT_NEAR(Number(program, name, "value"), Number(scene, name, "value"),
                0.5 * Number(scene, name, "sigma"));
  }
  EXPECT_EQ(program.at("failed"), 0);
}

// Nature's stops are softer than the scene's: the user must be told first that something is wrong.
TEST_F(FitVerbTest, AModelThatLacksSomethingIsToldInWords) {
  MakeTracks("tracks.h5", {"contact.lock.modulus_j=1e10"}, 5);
  MakeStudy("study.toml", kOneTrial + std::string("window = [0.0, 0.9]\n"),
            "[profile]\nlevels = []\n");
  const auto fit = nlohmann::json::parse(
      Good({"fit", "study.toml", "-o", "fit.h5", "--json", "--report", "fit.html"}).out);
  EXPECT_THAT(std::string(fit.at("verdict")),
              ::testing::StartsWith("The model does not explain the data; "));
  for (const auto& p : fit.at("parameters")) EXPECT_NE(p.at("verdict"), "determined");
  EXPECT_LT(fit.at("checks").at("p_covariances [1]"), 0.01);
  EXPECT_LT(fit.at("checks").at("p_noise [1]"), 0.01);
  const std::string page = Get("fit.html");
  EXPECT_THAT(page, HasSubstr("The model does not explain them"));
  // The scene has no beam: no finer mesh was run, and none may be appealed to.
  EXPECT_THAT(page, HasSubstr("No finer model was run"));
  EXPECT_THAT(page, ::testing::Not(HasSubstr("finer model, which takes")));
  EXPECT_THAT(page, ::testing::Not(HasSubstr("finer mesh")));
}

// Readings that scatter by twice what is stated may be noise: then the verdict stands under that
// condition.
TEST_F(FitVerbTest, WhatCouldBeNoiseIsACondition) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy(
      "study.toml",
      kOneTrial + std::string("window = [0.0, 0.9]\n[trial.sigma_factor]\nmid = 0.5\ntip = 0.5\n"),
      "[profile]\nlevels = []\n");
  const auto fit = nlohmann::json::parse(Good({"fit", "study.toml", "-o", "fit.h5", "--json"}).out);
  EXPECT_LT(fit.at("checks").at("p_covariances [1]"), 0.01);
  EXPECT_THAT(std::string(fit.at("verdict")), HasSubstr("residuals is noise"));
}

// A little friction that the scene lacks is smooth, and looks like noise that lasts; but it wants
// other values where the swings are small.
TEST_F(FitVerbTest, ALittleFrictionIsNoNoise) {
  MakeTracks("tracks.h5",
             {"joint.hinge.friction.moment=0.014", "joint.hinge.friction.creep_rate=0.1"}, 5);
  MakeStudy("study.toml", kOneTrial + std::string("window = [0.0, 0.9]\n"),
            "[profile]\nlevels = []\n");
  const auto fit = nlohmann::json::parse(Good({"fit", "study.toml", "-o", "fit.h5", "--json"}).out);
  EXPECT_LT(fit.at("checks").at("p_constant [1]"), 0.01);
  EXPECT_THAT(std::string(fit.at("verdict")),
              ::testing::StartsWith("The model does not explain the data; "));
}

TEST_F(FitVerbTest, StudiesThatCannotBeAreRefused) {
  MakeTracks("tracks.h5", {}, 5);
  MakeStudy("study.toml", kOneTrial);
  const std::vector<std::string> set = {"solver.starts=4", "solver.stages=\"latch\"",
                                        "model.command=[\"{clearence}\"]",
                                        "trial.sigma_factor.hub=2"};
  const std::vector<std::string> words = {"starts", "stages", "command", "hub"};
  for (std::size_t i = 0; i < set.size(); ++i) {
    const std::vector<std::string> before = Files();
    ExpectRefused(Run({"fit", "study.toml", "--set", set[i]}), {words[i]}, before);
  }
}

}  // namespace
}  // namespace unfurl::cli::fit_verb_test
