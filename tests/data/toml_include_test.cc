// Files that include others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "data/scene.h"
#include "data/toml.h"
#include "errors.h"
#include "scene_texts.h"

namespace unfurl::data::toml_include_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Include : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("unfurl_include_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_ / "parts");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  std::filesystem::path folder_;
};

TEST_F(Include, OwnKeysWinTableByTable) {
  Put("parts/body.toml",
      "[body.hub]\nmass = 1.0\ninertia = 2.0\n[gravity]\nacceleration = [0, 1]\n");
  Put("parts/common.toml", "include = ['body.toml']\n[body.hub]\nmass = 3.0\n");
  Put("later.toml", "[body.hub]\ninertia = 4.0\n[body.arm]\nmass = 9.0\n");
  const std::string path = Put("scene.toml",
                               "include = ['parts/common.toml', 'later.toml']\n"
                               "[body.hub]\nextra = 'x'\n[body.arm]\nmass = 8.0\n");
  const TomlTable t = LoadToml(path);
  const TomlTable hub = t.Table("body").Table("hub");
  EXPECT_EQ(hub.Number("mass"), 3.0);     // of common over body
  EXPECT_EQ(hub.Number("inertia"), 4.0);  // of the later over the earlier
  EXPECT_EQ(hub.String("extra"), "x");
  EXPECT_EQ(t.Table("body").Table("arm").Number("mass"), 8.0);
  EXPECT_THAT(t.Table("gravity").Numbers("acceleration", 2), ElementsAre(0.0, 1.0));
  EXPECT_EQ(t.Files().size(), 4u);
  t.RefuseUnknownKeys();
}

TEST_F(Include, MessagesNameTheFileOfTheKey) {
  Put("parts/common.toml", "[scene]\nname = 's'\nduration = 1.0\n\n[body.hub]\nmass = -1.0\n");
  const std::string path =
      Put("scene.toml", "include = ['parts/common.toml']\n[body.hub]\ninertia = 1\n");
  EXPECT_THAT(ErrorOf([&] { ReadScene(path); }),
              HasSubstr("parts/common.toml:6:body.hub.mass: -1 is out of range"));
  EXPECT_THAT(ErrorOf([&] { ReadScene(path, {"body.hub.mass=-2"}); }),
              HasSubstr("--set body.hub.mass: -2"));
  EXPECT_EQ(ReadScene(path, {"body.hub.mass=2"}).bodies[0].mass, 2.0);
  Put("parts/common.toml", "[scene]\nname = 's'\nduration = 1.0\n[body.hub]\nmass = 1\nmas = 2\n");
  EXPECT_THAT(ErrorOf([&] { ReadScene(path); }),
              HasSubstr("parts/common.toml:6:body.hub.mas: unknown key; did you mean 'mass'?"));
}

TEST_F(Include, BodiesStandAsIfPasted) {
  Put("common.toml", "[body.z]\nmass = 1\ninertia = 1\n[body.a]\nmass = 1\ninertia = 1\n");
  const std::string path = Put("scene.toml",
                               "include = ['common.toml']\n[scene]\nname = 's'\nduration = 1.0\n"
                               "[body.m]\nmass = 1\ninertia = 1\n[body.z]\nmass = 2\n");
  const Scene scene = ReadScene(path);
  ASSERT_EQ(scene.bodies.size(), 3u);
  EXPECT_EQ(scene.bodies[0].name, "z");
  EXPECT_EQ(scene.bodies[0].mass, 2.0);
  EXPECT_EQ(scene.bodies[1].name, "a");
  EXPECT_EQ(scene.bodies[2].name, "m");
  EXPECT_EQ(scene.files.size(), 2u);
}

TEST_F(Include, FromTheCommandLine) {
  Put("stiff.toml", "[beam.rod]\nEI = 99.0\nmass = 5.0\n");
  const std::string path =
      Put("scene.toml", std::string(kHead) + "[beam.rod]\nlength = 1.0\nmass = 1.0\n");
  const Scene scene = ReadScene(path, {"include=[\"stiff.toml\"]"});
  EXPECT_EQ(scene.beams[0].EI, 99.0);
  EXPECT_EQ(scene.beams[0].mass, 1.0);
}

TEST_F(Include, CirclesAndMissingFilesAreRefused) {
  Put("parts/b.toml", "include = ['../a.toml']\n");
  const std::string path = Put("a.toml", "# a\ninclude = ['parts/b.toml']\n");
  EXPECT_THAT(
      ErrorOf([&] { LoadToml(path); }),
      HasSubstr(
          "b.toml:1:include: the files include each other in a circle: a.toml > b.toml > a.toml"));
  Put("self.toml", "include = ['self.toml']\n");
  EXPECT_THAT(ErrorOf([&] { LoadToml((folder_ / "self.toml").string()); }),
              HasSubstr("self.toml > self.toml"));
  Put("a.toml", "\ninclude = ['nowhere.toml']\n");
  EXPECT_THAT(ErrorOf([&] { LoadToml(path); }), HasSubstr("a.toml:2:include: there is no file"));
  Put("a.toml", "include = 'b.toml'\n");
  EXPECT_THAT(ErrorOf([&] { LoadToml(path); }), HasSubstr("not a list of file names"));
  Put("a.toml", "include = ['parts/b.toml']\n");
  Put("parts/b.toml", "x = = 1\n");
  EXPECT_THAT(ErrorOf([&] { LoadToml(path); }), HasSubstr("b.toml:1:5: not valid TOML"));
}

// Each level includes the next twice: 2^20 files, were there no limit.
TEST_F(Include, TooManyFilesAreRefused) {
  for (int k = 0; k < 20; ++k) {
    const std::string next = "f" + std::to_string(k + 1) + ".toml";
    Put("f" + std::to_string(k) + ".toml", "include = ['" + next + "', '" + next + "']\n");
  }
  Put("f20.toml", "x = 1\n");
  EXPECT_THAT(ErrorOf([&] { LoadToml((folder_ / "f0.toml").string()); }),
              HasSubstr("more than 1000 files"));
}

}  // namespace
}  // namespace unfurl::data::toml_include_test
