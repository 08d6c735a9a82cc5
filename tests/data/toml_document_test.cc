// A document that is read once, and copies of it with other numbers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/toml.h"
#include "tests/own_folder.h"

namespace unfurl::data::toml_document_test {
namespace {

using ::testing::HasSubstr;

class Document : public ::testing::Test {
 protected:
  void SetUp() override {
    Put("base.toml", "[body.zebra]\nmass = 1\n[body.ant]\nmass = 2.5\n");
    Put("top.toml",
        "include = [\"base.toml\"]\n[gravity]\nacceleration = [0.0, -9.81]\n"
        "[table]\nrows = [[1.0, 2.0], [3.0, 4.0]]\n[body.mole]\nmass = 3\nsegments = 8\n");
  }
  std::string Path(const char* name) const { return folder_.File(name); }
  void Put(const char* name, const std::string& text) const { WriteTextFile(Path(name), text); }

  static std::string ErrorOf(const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }
  OwnFolder folder_;
};

TEST_F(Document, CopiesHoldTheNumbersAndTheOriginalStaysAsItIs) {
  const TomlDocument document(Path("top.toml"));
  const TomlTable copy = document.With({{"body.ant.mass", 0.75},
                                        {"gravity.acceleration[1]", -1.62},
                                        {"table.rows[1][0]", 30.5},
                                        {"body.mole.segments", 12.0}});
  EXPECT_EQ(copy.Table("body").Table("ant").Number("mass"), 0.75);
  EXPECT_EQ(copy.Table("gravity").Numbers("acceleration", 2), (std::vector<double>{0.0, -1.62}));
  EXPECT_EQ(copy.Table("table").Rows("rows", 2)[1], (std::vector<double>{30.5, 4.0}));
  EXPECT_EQ(copy.Table("body").Table("mole").Integer("segments", 1, 100), 12);
  EXPECT_EQ(document.table().Table("gravity").Numbers("acceleration", 2)[1], -9.81);
}

TEST_F(Document, CopiesKeepTheOrderOfNamedTables) {
  const TomlDocument document(Path("top.toml"));
  std::vector<std::string> before, after;
  for (const auto& named : document.table().NamedTables("body")) before.push_back(named.first);
  for (const auto& named : document.With({}).NamedTables("body")) after.push_back(named.first);
  EXPECT_THAT(before, ::testing::ElementsAre("zebra", "ant", "mole"));
  EXPECT_EQ(after, before);
}

TEST_F(Document, FilesAreReadOnceForAllWhoShareTheirTexts) {
  TextFiles texts;
  const TomlDocument first(Path("top.toml"), {}, &texts);
  Put("base.toml", "[body.ant]\nmass = 99\n");
  Put("top.toml", "[nothing]\n");
  const TomlDocument second(Path("top.toml"), {"gravity.acceleration[0]=0.5"}, &texts);
  EXPECT_EQ(second.table().Table("body").Table("ant").Number("mass"), 2.5);
  EXPECT_EQ(second.table().Table("gravity").Numbers("acceleration", 2)[0], 0.5);
  EXPECT_EQ(first.With({}).Table("body").Table("ant").Number("mass"), 2.5);
}

TEST_F(Document, NamesWhatCannotBeSet) {
  const TomlDocument document(Path("top.toml"));
  auto with = [&](const std::string& key) { return ErrorOf([&] { document.With({{key, 1.0}}); }); };
  EXPECT_THAT(with("gravity.acceleration[2]"), HasSubstr("--set gravity.acceleration[2]: "));
  EXPECT_THAT(with("gravity.acceleration[2]"), HasSubstr("no item 2"));
  EXPECT_THAT(with("gravity.acceleration[2]"), HasSubstr("it has 2"));
  EXPECT_THAT(with("body.ant.mass[0]"), HasSubstr("not an array"));
  EXPECT_THAT(with("gravity.nothing[0]"), HasSubstr("not an array"));
  for (const char* wrong : {"gravity.acceleration[]", "gravity.acceleration[x]",
                            "gravity.acceleration[1", "gravity.acceleration[1]2"}) {
    EXPECT_THAT(with(wrong), HasSubstr("is not a key")) << wrong;
  }
  // What a reader refuses of a number that was set is placed at its key.
  const TomlTable copy = document.With({{"gravity.acceleration[1]", 5.0}});
  EXPECT_THAT(ErrorOf([&] {
                copy.Table("gravity").Numbers("acceleration", 2, {-20.0, 0.0});
              }),
              HasSubstr("--set gravity.acceleration[1]: "));
}

TEST_F(Document, ItemsOfArraysAreSetFromTheCommandLineToo) {
  const TomlTable table =
      LoadToml(Path("top.toml"), {"table.rows[0][1]=7", "gravity.acceleration[0]=1e-3"});
  EXPECT_EQ(table.Table("table").Rows("rows", 2)[0][1], 7.0);
  EXPECT_EQ(table.Table("gravity").Numbers("acceleration", 2)[0], 1e-3);
}

}  // namespace
}  // namespace unfurl::data::toml_document_test
