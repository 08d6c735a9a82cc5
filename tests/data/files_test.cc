// HDF5, TOML and CSV as the records use them: round trips, and what each refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "base/error.h"
#include "data/atomic_file.h"
#include "data/csv.h"
#include "data/h5.h"
#include "data/toml.h"
#include "errors.h"
#include "tests/own_folder.h"

namespace unfurl::data::files_test {
namespace {

using ::testing::HasSubstr;

class Files : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.File(name); }
  std::string Put(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name), std::ios::binary) << text;
    return Path(name);
  }
  std::size_t FileCount() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(folder_.path()), {}));
  }
  OwnFolder folder_;
};

void WriteSample(const std::string& path) {
  Provenance provenance{.program = "unfurl test", .command = "test"};
  provenance.options["rtol"] = "1e-6";
  provenance.seed = 18446744073709551615ULL;
  H5Writer writer(path, "unfurl/sample", 2, provenance);
  H5Series series = writer.Series({"/a/b", "m", "rows"}, H5Type::kDouble, {2}, 3, 1);
  for (int i = 0; i < 5; ++i) {
    const double row[] = {1.0 * i, 10.0 * i};
    series.Append(row);
  }
  writer.Write({"/names", "1", "names"}, std::vector<std::string>{"one", "", "three"});
  writer.Write({"/matrix", "px", "m"}, Eigen::MatrixXd{{1, 2, 3}, {4, 5, 6}});
  writer.Attribute("/a", "depth", 3.5);
  writer.Attribute("/", "long", std::string(200000, 'x'));
  writer.Commit();
}

TEST_F(Files, Hdf5GivesBackWhatWasWritten) {
  WriteSample(Path("s.h5"));
  const H5Reader reader(Path("s.h5"), "unfurl/sample", 2);
  EXPECT_EQ(reader.Dims("/a/b"), (std::vector<std::size_t>{5, 2}));
  EXPECT_EQ(reader.ReadDoubles("/a/b", "m")[7], 30.0);
  std::vector<double> rows(4);
  reader.ReadRows("/a/b", 2, 2, rows);
  EXPECT_EQ(rows, (std::vector<double>{2, 20, 3, 30}));
  EXPECT_EQ(reader.ReadStrings("/names"), (std::vector<std::string>{"one", "", "three"}));
  EXPECT_EQ(reader.ReadMatrix("/matrix")(1, 2), 6.0);
  EXPECT_EQ(reader.DoubleAttribute("/a", "depth"), 3.5);
  EXPECT_EQ(reader.StringAttribute("/", "long").size(), 200000u);
  EXPECT_EQ(reader.Children("/"), (std::vector<std::string>{"a", "names", "matrix", "letters_6"}));
  EXPECT_EQ(reader.ReadProvenance().seed, 18446744073709551615ULL);
  EXPECT_EQ(reader.ReadProvenance().options.at("rtol"), "1e-6");
}

TEST_F(Files, Hdf5OfTheSameContentHasTheSameBytes) {
  WriteSample(Path("a.h5"));
  WriteSample(Path("b.h5"));
  EXPECT_EQ(ReadTextFile(Path("a.h5")), ReadTextFile(Path("b.h5")));
}

TEST_F(Files, Hdf5UncommittedLeavesNothing) {
  {
    H5Writer writer(Path("s.h5"), "unfurl/sample", 1, {});
    writer.Write({"/x", "m", "x"}, std::vector<double>{1.0});
  }
  EXPECT_EQ(FileCount(), 0u);
}

TEST_F(Files, Hdf5RefusesByName) {
  WriteSample(Path("s.h5"));
  const std::string whole = ReadTextFile(Path("s.h5"));
  const auto open = [](const std::string& p) {
    return ErrorOf([&] { H5Reader(p, "unfurl/run", 1); });
  };
  EXPECT_THAT(open(Path("none.h5")), HasSubstr("no such file"));
  EXPECT_THAT(open(Put("text.h5", "hello")), HasSubstr("not an HDF5 file"));
  EXPECT_THAT(open(Path("s.h5")),
              HasSubstr("is 'unfurl/sample', where a run (of `unfurl simulate`) is needed"));
  EXPECT_THAT(open(Put("half.h5", whole.substr(0, whole.size() / 2))), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf([&] { H5Reader(Path("s.h5"), "unfurl/sample", 1); }), HasSubstr("newer"));
  const H5Reader reader(Path("s.h5"), "unfurl/sample", 2);
  EXPECT_THAT(ErrorOf([&] { reader.ReadDoubles("/a/b", "s"); }), HasSubstr("is in [m], not [s]"));
  EXPECT_THAT(ErrorOf([&] { reader.ReadDoubles("/a/c"); }), HasSubstr("/a/c: has no such dataset"));
  EXPECT_THAT(ErrorOf([&] { reader.ReadDoubles("/names"); }), HasSubstr("text, not numbers"));
}

TEST_F(Files, AtomicFileRefusesAFolderThatIsNotThere) {
  EXPECT_THAT(ErrorOf([&] { AtomicFile(Path("no/where.h5")); }), HasSubstr("no such folder"));
}

TEST_F(Files, AtomicFileRefusesToReplaceADevice) {
  EXPECT_THAT(ErrorOf([&] { AtomicFile("/dev/null"); }), HasSubstr("not a file"));
}

TEST_F(Files, AtomicFileKeepsTheOldFileUntilCommit) {
  WriteTextFile(Path("f"), "old");
  { AtomicFile file(Path("f")); }
  EXPECT_EQ(ReadTextFile(Path("f")), "old");
  WriteTextFile(Path("f"), "new");
  EXPECT_EQ(ReadTextFile(Path("f")), "new");
  EXPECT_EQ(FileCount(), 1u);
}

TEST(Toml, UnknownKeysNameTheNearest) {
  const TomlTable t = ParseToml("mass = 1.0\n[beam.b1]\nlenght = 2.0\n", "s.toml");
  EXPECT_EQ(t.Number("mass"), 1.0);
  const auto beams = t.NamedTables("beam");
  ASSERT_EQ(beams.size(), 1u);
  EXPECT_EQ(beams[0].second.NumberOr("length", 5.0), 5.0);
  EXPECT_EQ(ErrorOf([&] { t.RefuseUnknownKeys(); }),
            "s.toml:3:beam.b1.lenght: unknown key; did you mean 'length'?");
}

TEST(Toml, ErrorsAreLocated) {
  const TomlTable t = ParseToml("a = -1\nb = nan\nc = 'x'\nd = [1, 2]\n[t]\n", "s.toml");
  const auto error = [&](const char* key) { return ErrorOf([&] { t.Number(key, kPositive); }); };
  EXPECT_EQ(error("a"), "s.toml:1:a: -1 is out of range; it must be above 0");
  EXPECT_THAT(error("b"), HasSubstr("s.toml:2:b: is not a finite number"));
  EXPECT_THAT(error("c"), HasSubstr("s.toml:3:c: holds a string, not a number"));
  EXPECT_THAT(error("e"), HasSubstr("'e' is missing"));
  EXPECT_THAT(ErrorOf([&] { t.Numbers("d", 3); }), HasSubstr("holds 2 values; give 3"));
  EXPECT_THAT(ErrorOf([&] { t.Choice("c", {"xy", "z"}); }), HasSubstr("did you mean 'xy'?"));
  EXPECT_THAT(ErrorOf([&] { t.Integer("a", 0, 9); }), HasSubstr("from 0 to 9"));
  EXPECT_THAT(ErrorOf([&] { ParseToml("a = = 1", "s.toml"); }), HasSubstr("s.toml:1:"));
}

TEST(Toml, NamedTablesKeepTheOrderOfTheFile) {
  const TomlTable t = ParseToml("[j.z]\n[j.a]\n[j.m]\n[[k]]\nv = 1\n[[k]]\nv = 2\n", "s.toml");
  std::string order;
  for (const auto& [name, table] : t.NamedTables("j")) order += name;
  EXPECT_EQ(order, "zam");
  EXPECT_EQ(t.TableArray("k").at(0).Number("v"), 1.0);
  EXPECT_EQ(t.TableArray("k").at(1).Number("v"), 2.0);
  t.RefuseUnknownKeys();
}

TEST_F(Files, TomlOverridesReplaceAndAdd) {
  const std::string path = Put("s.toml", "[beam.b1]\nsegments = 4\n");
  const TomlTable t =
      LoadToml(path, {"beam.b1.segments=8", "beam.b1.axial=rigid", "gravity.g=9.5"});
  const TomlTable b1 = t.Table("beam").Table("b1");
  EXPECT_EQ(b1.Integer("segments", 1, 100), 8);
  EXPECT_EQ(b1.String("axial"), "rigid");
  EXPECT_EQ(t.Table("gravity").Number("g"), 9.5);
  EXPECT_THAT(ErrorOf([&] { b1.Integer("segments", 1, 4); }), HasSubstr("--set beam.b1.segments"));
  EXPECT_THAT(ErrorOf([&] { LoadToml(path, {"beam"}); }), HasSubstr("has no '='"));
  EXPECT_THAT(ErrorOf([&] { LoadToml(path, {"beam.b1.segments.x=1"}); }), HasSubstr("not a table"));
}

TEST_F(Files, CsvReadsUnitsAndPlacesErrors) {
  const std::string path =
      Put("p.csv", "# made by hand\nid,x [m],u1 [px]\nA,1.5,\n\"B\",nan,3\nC,2,4\n");
  const CsvTable table = CsvTable::Load(path);
  EXPECT_EQ(table.rows(), 3u);
  EXPECT_EQ(table.comments().at(0), "made by hand");
  const int x = table.Require("x", "m"), u = table.Require("u1", "px");
  EXPECT_EQ(table.Number(0, x), 1.5);
  EXPECT_TRUE(std::isnan(table.NumberOrNan(0, u)));
  EXPECT_EQ(table.Text(1, 0), "B");
  EXPECT_THAT(ErrorOf([&] { table.Number(1, x); }), HasSubstr("p.csv:4:x: 'nan' is not a finite"));
  EXPECT_THAT(ErrorOf([&] { table.Require("x", "mm"); }), HasSubstr("is in [m]"));
  EXPECT_THAT(ErrorOf([&] { table.Require("y", "m"); }),
              HasSubstr("add it to the header as 'y [m]'"));
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("q.csv", "a,b\n1\n")); }), HasSubstr("q.csv:2"));
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("e.csv", "")); }), HasSubstr("is empty"));
}

TEST_F(Files, CsvNumbersReadBackExactly) {
  CsvWriter writer({{"x", "m"}, {"y", ""}});
  writer.Row(std::vector<double>{0.1 + 0.2, std::nan("")});
  const CsvTable table = CsvTable::Load(Put("r.csv", writer.text()));
  EXPECT_EQ(table.Number(0, 0), 0.1 + 0.2);
  EXPECT_TRUE(table.Empty(0, 1));
}

TEST_F(Files, CsvCellsInQuotes) {
  const CsvTable table =
      CsvTable::Load(Put("q.csv", "\"a, b\",c\n\"one, two\", \"say \"\"no\"\"\" \nx,\"\"\n"));
  EXPECT_EQ(table.columns().at(0).name, "a, b");
  EXPECT_EQ(table.Text(0, 0), "one, two");
  EXPECT_EQ(table.Text(0, 1), "say \"no\"");
  EXPECT_TRUE(table.Empty(1, 1));
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("o.csv", "a,b\n\"1,2\n")); }),
              HasSubstr("o.csv:2: a cell's quote is not closed"));
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("g.csv", "a,b\n\"1\"2,3\n")); }),
              HasSubstr("g.csv:2: a cell goes on"));
}

TEST_F(Files, CsvOfOtherCountriesIsNamed) {
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("s.csv", "x [m];y [m]\n1,5;2\n")); }),
              HasSubstr("s.csv:1: its cells are separated by semicolons"));
  EXPECT_THAT(ErrorOf([&] { CsvTable::Load(Put("t.csv", "x [m]\ty [m]\n1\t2\n")); }),
              HasSubstr("separated by tabs"));
  const CsvTable comma = CsvTable::Load(Put("c.csv", "x [m],y [m]\n\"1,5\",2\n"));
  EXPECT_THAT(ErrorOf([&] { comma.Number(0, 0); }),
              HasSubstr("write a decimal point, not a comma"));
}

// What a spreadsheet would run, and what would break the table, goes out and comes back.
TEST_F(Files, CsvNamesReadBackExactly) {
  const std::vector<std::string> names = {"mark1",
                                          "=cmd|'/C calc'!A0",
                                          "+1+1",
                                          "-2+3",
                                          "@SUM(A1)",
                                          "a,b",
                                          "say \"no\"",
                                          " blank ",
                                          "'=x",
                                          "''=y",
                                          "'quoted'",
                                          "#5",
                                          "-1.5",
                                          "\tx",
                                          ""};
  CsvWriter writer({{"mark", ""}, {"=name", "m"}});
  for (const std::string& name : names) writer.Row(std::vector<std::string>{name, "1"});
  const std::string text = writer.text();
  for (const char* run : {"\n=", "\n+", "\n@", "\n-2", ",=", "\"="}) {
    EXPECT_EQ(text.find(run), std::string::npos) << run << text;
  }
  const CsvTable table = CsvTable::Load(Put("n.csv", text));
  EXPECT_EQ(table.columns().at(1).name, "=name");
  ASSERT_EQ(table.rows(), names.size());
  for (std::size_t i = 0; i < names.size(); ++i) EXPECT_EQ(table.Text(i, 0), names[i]);
}

TEST_F(Files, CsvOfManyColumns) {
  std::string head, row;
  for (int c = 0; c < 100000; ++c) {
    head += (c > 0 ? ",c" : "c") + std::to_string(c);
    row += c > 0 ? ",1" : "1";
  }
  EXPECT_EQ(CsvTable::Load(Put("w.csv", head + "\n" + row + "\n")).columns().size(), 100000u);
}

TEST_F(Files, TomlKeysOfManyParts) {
  std::string key = "a";
  for (int k = 0; k < 20000; ++k) key += ".a";
  EXPECT_THAT(ErrorOf([&] { LoadToml(Put("k.toml", "[x]\n" + key + " = 1\n")); }),
              HasSubstr("k.toml:2: a key of more than 64 parts"));
  EXPECT_THAT(ErrorOf([&] { LoadToml(Put("h.toml", "[" + key + "]\n")); }), HasSubstr("64 parts"));
  EXPECT_THAT(ErrorOf([&] { LoadToml(Put("i.toml", "x = {y = 1, " + key + " = 2}\n")); }),
              HasSubstr("64 parts"));
  EXPECT_THAT(ErrorOf([&] { LoadToml(Put("o.toml", ""), {key + "=1"}); }), HasSubstr("parts"));
  // Dots in strings, comments and numbers are none of a key's.
  const std::string dots(200, '.');
  EXPECT_EQ(LoadToml(Put("s.toml", "# " + dots + "\nx = \"" + dots + "\"\ny = '" + dots +
                                       "'\nz = \"\"\"\n" + dots + "\n\\\"" + dots + "\"\"\"\n"))
                .String("x"),
            dots);
}

TEST_F(Files, TomlNamesThatAreNoNames) {
  for (const char* name : {"\"a/b\"", "\"\\u001b[2Jx\"", "\"\"", "\"a\\nb\"", "\".\"",
                           "\"\\u009b2J\"", "\"a\\u202eb\""}) {
    const std::string text = std::string("[body.") + name + "]\nmass = 1.0\n";
    EXPECT_NE(ErrorOf([&] { LoadToml(Put("n.toml", text)).NamedTables("body"); }), "no error")
        << name;
  }
  EXPECT_EQ(LoadToml(Put("g.toml", "[body.\"Außen 1\"]\n")).NamedTables("body").size(), 1u);
}

TEST_F(Files, TomlTextWithControlCharacters) {
  const auto read = [&](const std::string& line) {
    const TomlTable table = LoadToml(Put("c.toml", line + "\n"));
    table.Has("name") ? (void)table.String("name") : (void)table.Strings("words");
  };
  for (const char* line : {"name = \"\\u001b[2J\"", "name = \"a\\nunfurl: all is well\"",
                           "name = \"\\u009b2J\"", "words = [\"good\", \"b\\u0007\"]"}) {
    EXPECT_THAT(ErrorOf([&] { read(line); }), HasSubstr("holds a control character")) << line;
  }
  EXPECT_EQ(ErrorOf([&] { read("name = \"Außen 1\""); }), "no error");
  EXPECT_EQ(ErrorOf([&] { read("words = [\"python3\", '''\nimport os\n\tpass'''] "); }),
            "no error");
}

TEST_F(Files, WhatIsHashedIsWhatWasParsed) {
  const std::string path = Put("in.toml", "x = 1\n");
  const std::string hash = FileSha256(path);
  LoadToml(path);
  Put("in.toml", "x = 2\n");  // behind the reader's back
  Provenance provenance;
  provenance.AddInput(path);
  EXPECT_EQ(provenance.inputs.at(0).sha256, hash);

  WriteSample(Path("s.h5"));
  { const H5Reader reader(Path("s.h5"), "unfurl/sample", 2); }
  std::ofstream(Path("s.h5"), std::ios::app) << "more";
  EXPECT_THAT(ErrorOf([&] { provenance.AddInput(Path("s.h5")); }), HasSubstr("changed while"));
  WriteSample(Path("s.h5"));
  EXPECT_EQ(ErrorOf([&] { provenance.AddInput(Path("s.h5")); }), "no error");
}

TEST_F(Files, TemporariesOfDeadProgramsGo) {
  const std::string left = Path(".out.txt.abc123.tmp"), other = Path(".other.txt.abc123.tmp"),
                    young = Path(".out.txt.abc124.tmp");
  for (const std::string& path : {left, other, young}) std::ofstream(path) << "half";
  using std::filesystem::last_write_time;
  const auto old = last_write_time(left) - std::chrono::hours(1);
  last_write_time(left, old);
  last_write_time(other, old);
  WriteTextFile(Path("out.txt"), "whole");
  EXPECT_FALSE(std::filesystem::exists(left));
  EXPECT_TRUE(std::filesystem::exists(other));
  EXPECT_TRUE(std::filesystem::exists(young));
  // One that is being written is locked, however old it looks.
  TextFileWriter writing(Path("long.txt"));
  std::string held;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().filename().string().starts_with(".long.txt")) held = entry.path().string();
  }
  ASSERT_FALSE(held.empty());
  last_write_time(held, old);
  WriteTextFile(Path("long.txt"), "another");
  writing.Append("mine");
  writing.Commit();
  EXPECT_EQ(ReadTextFile(Path("long.txt")), "mine");
}

TEST_F(Files, PartialsFollowNoLinks) {
  Put("victim", "precious");
  std::filesystem::create_symlink(Path("victim"), Path("run.h5.partial"));
  EXPECT_THAT(ErrorOf([&] { AtomicFile(Path("run.h5"), AtomicFile::Temporary::kPartial); }),
              HasSubstr("is a link, which is not followed"));
  EXPECT_EQ(ReadTextFile(Path("victim")), "precious");
}

}  // namespace
}  // namespace unfurl::data::files_test
