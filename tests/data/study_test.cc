#include "data/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/source_dir.h"

namespace unfurl::data::study_test {
namespace {

using ::testing::HasSubstr;

constexpr char kGood[] = R"(
[study]
scene = "scene.toml"
set = ["beam.b.segments=6"]
[trial]
tracks = "tracks.h5"
marks = ["a", "b"]
window = [0.1, 2.5]
[parameter.clearance]
keys = ["joint.j.latch.theta_a", "joint.j.latch.theta_b"]
unit = "rad"
start = 0.005
bounds = [0.001, 0.02]
transform = "log"
prior = { mean = 0.005, sigma = 0.001 }
[model]
rtol = 1e-6
[solver]
stages = [1.0, 2.0]
[fidelity]
segments = [8, 12, 16]
order = [4]
)";

std::string Message(const std::string& text) {
  try {
    ParseStudy(text, "folder/s.toml");
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

std::string Replaced(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(Study, TheToleranceIsTheDatasChoiceUnlessGiven) {
  EXPECT_EQ(ParseStudy(kGood, "s.toml").rtol, 1e-6);
  EXPECT_EQ(ParseStudy(Replaced("rtol = 1e-6", ""), "s.toml").rtol, 0.0);
  EXPECT_EQ(ParseStudy(Replaced("rtol = 1e-6", "rtol = \"auto\""), "s.toml").rtol, 0.0);
  EXPECT_THAT(Message(Replaced("rtol = 1e-6", "rtol = \"fast\"")), HasSubstr("auto"));
  EXPECT_THAT(Message(Replaced("rtol = 1e-6", "rtol = 0.0")), HasSubstr("rtol"));
}

TEST(Study, ReadsWhatAPersonWrote) {
  const Study s = ParseStudy(kGood, "folder/s.toml");
  EXPECT_EQ(s.name, "s");
  EXPECT_EQ(s.scene, "folder/scene.toml");  // beside the study
  ASSERT_EQ(s.trials.size(), 1u);
  EXPECT_EQ(s.trials[0].tracks, "folder/tracks.h5");
  EXPECT_EQ(s.trials[0].marks, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(s.trials[0].window_high, 2.5);
  ASSERT_EQ(s.parameters.size(), 1u);
  const StudyParameter& p = s.parameters[0];
  EXPECT_EQ(p.name, "clearance");
  EXPECT_EQ(p.keys.size(), 2u);
  EXPECT_TRUE(p.log);
  ASSERT_TRUE(p.prior.has_value());
  EXPECT_EQ(p.prior->sigma, 0.001);
  EXPECT_EQ(s.stages, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(s.rtol, 1e-6);
  ASSERT_EQ(s.fidelity.rungs.size(), 4u);
  EXPECT_EQ(s.fidelity.rungs[1].segments, 12);
  EXPECT_EQ(s.fidelity.rungs[3].segments, 0);
  EXPECT_EQ(s.fidelity.rungs[3].order, 4);
}

TEST(Study, TheLadderIsClimbedUnlessSaidOtherwise) {
  const std::string none = Replaced("[fidelity]\nsegments = [8, 12, 16]\norder = [4]\n", "");
  EXPECT_TRUE(ParseStudy(none, "s.toml").fidelity.wanted);
  EXPECT_TRUE(ParseStudy(none, "s.toml").fidelity.rungs.empty());
  EXPECT_FALSE(ParseStudy(none + "[fidelity]\nwanted = false\n", "s.toml").fidelity.wanted);
  EXPECT_THAT(Message(Replaced("[8, 12, 16]", "[8, 16, 12]")), HasSubstr("rising"));
  EXPECT_THAT(Message(Replaced("[8, 12, 16]", "[8.5]")), HasSubstr("fidelity.segments"));
  EXPECT_THAT(Message(Replaced("[8, 12, 16]", "[0]")), HasSubstr("fidelity.segments"));
  const std::string rung =
      none + "[[fidelity.rung]]\n[[fidelity.rung]]\nset = [\"beam.b.segments=9\"]\nerror = 0.4\n";
  ASSERT_EQ(ParseStudy(rung, "s.toml").fidelity.rungs.size(), 2u);
  EXPECT_EQ(ParseStudy(rung, "s.toml").fidelity.rungs[1].error, 0.4);
  EXPECT_THAT(Message(rung + "segments = 3\norder = 2\n"), HasSubstr("keep one"));
  EXPECT_THAT(Message(none + "[fidelity]\nsegments = [4]\n[[fidelity.rung]]\norder = 2\n"),
              HasSubstr("given twice"));
}

TEST(Study, TheOldCheckOfTheMeshIsNamedWithItsRemedy) {
  EXPECT_THAT(Message(std::string(kGood) + "[mesh_check]\nwanted = false\n"),
              ::testing::AllOf(HasSubstr("mesh_check"), HasSubstr("fidelity.segments")));
}

TEST(Study, NamesFileKeyAndRemedyOfWhatIsWrong) {
  EXPECT_THAT(Message(Replaced("start = 0.005", "start = 0.5")),
              HasSubstr("folder/s.toml:12:parameter.clearance.start"));
  EXPECT_THAT(Message(Replaced("[0.001, 0.02]", "[0.02, 0.001]")), HasSubstr("encloses nothing"));
  EXPECT_THAT(Message(Replaced("[0.001, 0.02]", "[-0.001, 0.02]")), HasSubstr("logarithm"));
  // What may come to nothing has a lower bound of 0, and begins above it.
  EXPECT_EQ(ParseStudy(Replaced("[0.001, 0.02]", "[0.0, 0.02]"), "s.toml").parameters[0].low, 0.0);
  EXPECT_THAT(Message(Replaced("sigma = 0.001", "sigma = 0")), HasSubstr("prior.sigma"));
  EXPECT_THAT(Message(Replaced("window = [0.1, 2.5]", "window = [2.5, 0.1]")),
              HasSubstr("trial.window"));
  EXPECT_THAT(Message(Replaced("stages = [1.0, 2.0]", "stages = [2.0, 1.0]")), HasSubstr("rise"));
  EXPECT_THAT(Message(Replaced("transform =", "tranform =")), HasSubstr("transform"));
  EXPECT_THAT(Message(Replaced("scene = ", "scen = ")), HasSubstr("scene"));
  EXPECT_THAT(Message(Replaced("\"joint.j.latch.theta_b\"", "\"joint.j.latch.theta_a\"")),
              HasSubstr("driven"));
  EXPECT_THAT(Message("[study]\nscene = \"a\"\n[trial]\ntracks = \"t\"\n"),
              HasSubstr("without parameters"));
}

TEST(Study, TheShippedOneIsWhole) {
  const std::string folder = UNFURL_SOURCE_DIR "/data/sets/deployment/";
  const Study s = ReadStudy(folder + "study.toml");
  EXPECT_EQ(s.scene, folder + "scene_suspension.toml");
  ASSERT_EQ(s.parameters.size(), 2u);
  EXPECT_EQ(s.parameters[0].keys.size(), 8u);
  EXPECT_TRUE(s.fidelity.wanted);
}

}  // namespace
}  // namespace unfurl::data::study_test
