#include "data/toml_kind.h"

#include <gmock/gmock.h>

#include "tests/data/errors.h"

namespace unfurl::data::toml_kind_test {
namespace {

using ::testing::HasSubstr;

TEST(TomlKind, TellsByTheTables) {
  const auto kind = [](const char* text) { return KindOfDocument(ParseToml(text, "x.toml")); };
  EXPECT_EQ(kind("[scene]\n[body.a]\n"), "scene");
  EXPECT_EQ(kind("[study]\n[parameter.k]\n"), "study");
  EXPECT_EQ(kind("[variable.k]\n[job]\n"), "campaign");
  EXPECT_EQ(kind("[recording]\n[camera.a]\n"), "raw lines");
  EXPECT_EQ(kind("seed = 1\n[camera.a]\n"), "lab");
  EXPECT_EQ(kind("[scene]\n"), "TOML");
}

// What is not known may be what is wanted, and its reader says what it lacks.
TEST(TomlKind, RequiresOnlyOfWhatItKnows) {
  const TomlTable lab = ParseToml("[camera.a]\n", "x.toml");
  EXPECT_NO_THROW(RequireKind(lab, "lab"));
  EXPECT_NO_THROW(RequireKind(ParseToml("[other]\n", "x.toml"), "lab"));
  try {
    RequireKind(lab, "scene");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.problem(), "is a laboratory, where a scene is needed");
    EXPECT_THAT(error.where(), HasSubstr("x.toml"));
  }
}

TEST(TomlKind, AGuessIsAddedAndNeverPutInTheFaultsPlace) {
  const auto told = [](const char* text) {
    const TomlTable root = ParseToml(text, "x.toml");
    try {
      ReadAsKind(root, "study", [&] { return root.Table("study").Number("value"); });
    } catch (const Error& error) {
      return error;
    }
    return Error("nothing", "", "");
  };
  EXPECT_EQ(told("[studdy]\nvalue = 1\n").problem(), "[study] is missing");
  EXPECT_EQ(told("[studdy]\nvalue = 1\n").remedy(), "did you mean [study] by [studdy]?");
  // Nothing of a near name: as it was.
  EXPECT_EQ(told("[elsewhere]\nvalue = 1\n").remedy(), "add it");
  // A table that was read is not a guess.
  EXPECT_THAT(told("[study]\nvalue = \"x\"\n").problem(), HasSubstr("a string, not a number"));
  EXPECT_THAT(told("[study]\nvalue = \"x\"\n").remedy(), ::testing::Not(HasSubstr("did you mean")));
}

}  // namespace
}  // namespace unfurl::data::toml_kind_test
