// What could be measured, and files that are written anew.
#include "data/design.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "data/study.h"
#include "data/toml_study.h"
#include "data/toml_override.h"

namespace unfurl::data::design_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Refused(const std::string& text) {
  try {
    ParseDesign(text, "next.toml");
  } catch (const Error& e) {
    return e.what();
  }
  return "taken";
}

TEST(Design, CandidatesAreRead) {
  const Design d = ParseDesign(
      "[mark.far]\non = \"panel.end\"\npoint = [0.1, -0.02]\n"
      "[channel.gyro]\nquantity = \"hub.omega\"\nunit = \"deg/s\"\nrate = 500\nsigma = 0.05\n"
      "bias = \"free\"\ngain = { mean = 1.0, sigma = 0.02 }\n"
      "[channel.lock]\nevent = \"latch\"\njoint = \"hinge\"\nsigma = 1e-4\n"
      "[trial.softer]\nset = [\"joint.hinge.spring.preload=0.5\"]\n",
      "next.toml");
  ASSERT_EQ(d.marks.size(), 1U);
  EXPECT_THAT(d.marks[0].set,
              ElementsAre("mark.far.on=\"panel.end\"", "mark.far.point=[0.1, -0.02]"));
  ASSERT_EQ(d.channels.size(), 2U);
  EXPECT_EQ(d.channels[0].rate, 500.0);
  EXPECT_EQ(d.channels[0].channel.gain.sigma, 0.02);
  EXPECT_EQ(d.channels[1].channel.event, "latch");
  EXPECT_EQ(d.channels[1].channel.sigma, 1e-4);
  EXPECT_THAT(d.trials[0].set, ElementsAre("joint.hinge.spring.preload=0.5"));
}

TEST(Design, WhatIsWrongIsNamedWithItsPlace) {
  EXPECT_THAT(Refused("[mark.a]\npoint = [0, 0]\n"), HasSubstr("next.toml:1:mark.a"));
  EXPECT_THAT(Refused("[channel.a]\nquantity = \"x\"\nrate = 0\nsigma = 1\n"),
              HasSubstr("next.toml:3:channel.a.rate"));
  EXPECT_THAT(Refused("[channel.a]\nquantity = \"x\"\nrate = 10\n"), HasSubstr("sigma"));
  EXPECT_THAT(Refused("[channel.a]\nevent = \"latch\"\njoint = \"j\"\n"), HasSubstr("sigma"));
  EXPECT_THAT(Refused("[trial.a]\nsets = []\n"), HasSubstr("set"));
  EXPECT_THAT(Refused("[marks.a]\non = \"b\"\n"), HasSubstr("mark"));
}

class WrittenToml : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("unfurl_written-" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  std::filesystem::path folder_;
};

TEST_F(WrittenToml, KeysStayInTheirOrderAndNumbersAsTheyAre) {
  const std::string path =
      Put("lab.toml",
          "seed = 3\nrate = 0.06  # fast\n[zebra]\non = true\n"
          "[camera.south]\nx = [1.0, 2.87054]\n[camera.north]\nx = [0.1, 3e-9]\n"
          "[[hit]]\nt = 1\n[[hit]]\nt = 2\n[apple]\n'odd key' = \"a\"\n"
          "table = { b = 1, a = 2 }\n");
  EXPECT_EQ(TextWithOverrides(path, {"camera.south.x=[0, 0.5]"}),
            "seed = 3\nrate = 0.06\n\n[zebra]\non = true\n\n[camera.south]\nx = [0, 0.5]\n\n"
            "[camera.north]\nx = [0.1, 3e-09]\n\n[[hit]]\nt = 1\n\n[[hit]]\nt = 2\n\n[apple]\n"
            "'odd key' = 'a'\ntable = { a = 2, b = 1 }\n");
}

TEST_F(WrittenToml, OfAFileThatIncludesOthersTheirOrderIsTheReaders) {
  Put("common.toml", "[camera.b]\nx = 1\n[camera.c]\nx = 2\n");
  const std::string path = Put("top.toml", "include = [\"common.toml\"]\n[camera.a]\nx = 3\n");
  const std::string text = TextWithOverrides(path, {});
  const TomlTable before = LoadToml(path), after = ParseToml(text, "again");
  std::vector<std::string> names[2];
  for (const auto& [name, table] : before.NamedTables("camera")) names[0].push_back(name);
  for (const auto& [name, table] : after.NamedTables("camera")) names[1].push_back(name);
  EXPECT_EQ(names[0], names[1]) << text;
}

TEST_F(WrittenToml, AStudyWithOneMoreTrial) {
  const std::string path =
      Put("study.toml",
          "[study]\nscene = \"scene.toml\"\n[trial]\ntracks = \"a.h5\"\nset = [\"x=1\"]\n"
          "[trial.event.first]\njoint = \"hinge\"\ntime = 0.5\nsigma = 1e-3\n"
          "[parameter.k]\nkeys = [\"joint.hinge.spring.stiffness\"]\nstart = 1.0\nbounds = [0.0, "
          "2.0]\n");
  const Study s = ParseStudy(StudyWithTrial(path, {}, 0, "softer", "softer.h5", {"y=2"}), "next");
  ASSERT_EQ(s.trials.size(), 2U);
  EXPECT_EQ(s.trials[0].events.size(), 1U);
  EXPECT_EQ(s.trials[1].name, "softer");
  EXPECT_EQ(s.trials[1].tracks, "softer.h5");
  EXPECT_THAT(s.trials[1].set, ElementsAre("x=1", "y=2"));
  EXPECT_TRUE(s.trials[1].events.empty());
  EXPECT_THROW(StudyWithTrial(path, {}, 1, "n", "n.h5", {}), Error);
}

}  // namespace
}  // namespace unfurl::data::design_test
