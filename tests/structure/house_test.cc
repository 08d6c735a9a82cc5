// The rules themselves: each is seen to find a planted violation, and to pass what is allowed.
#include "house.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace unfurl::structure::house_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(CheckIncludes, FindsEveryForbiddenArrow) {
  const std::vector<std::pair<std::string, std::string>> forbidden = {
      {"base", "data"},         {"base", "cli"},      {"data", "sim"},
      {"data", "report"},       {"sim", "measure"},   {"sim", "calib"},
      {"measure", "sim"},       {"measure", "calib"}, {"correlate", "sim"},
      {"report", "sim"},        {"report", "cli"},    {"correlate", "report"},
      {"correlate", "measure"}, {"calib", "sim"},     {"calib", "correlate"},
      {"calib", "report"},      {"calib", "cli"},     {"study", "campaign"},
      {"campaign", "report"},   {"campaign", "cli"}};
  for (const auto& [from, to] : forbidden) {
    const Findings found =
        CheckIncludes(from + "/a.cc", "#include <cmath>\n#include \"" + to + "/b.h\"\n");
    EXPECT_THAT(found, ElementsAre(from + "/a.cc:2: " + from + " must not know " + to));
  }
}

TEST(CheckIncludes, PassesTheArrowsOfTheHouse) {
  const std::vector<std::pair<std::string, std::string>> allowed = {
      {"data", "base"},   {"sim", "data"},      {"measure", "base"},   {"correlate", "data"},
      {"report", "data"}, {"calib", "measure"}, {"cli", "sim"},        {"cli", "report"},
      {"cli", "calib"},   {"sim", "sim"},       {"campaign", "study"}, {"cli", "campaign"}};
  for (const auto& [from, to] : allowed) {
    EXPECT_THAT(CheckIncludes(from + "/a.h", "#include \"" + to + "/b.h\"\n"), IsEmpty());
  }
}

TEST(CheckIncludes, KeepsTheStatisticsOfCampaignsToThemselves) {
  const std::string path = "campaign/statistics/a.cc";
  EXPECT_THAT(CheckIncludes(path, "#include \"data/run.h\"\n"),
              ElementsAre(HasSubstr("campaign/statistics/ must not know data/run.h")));
  EXPECT_THAT(CheckIncludes(path, "#include \"campaign/plan.h\"\n"),
              ElementsAre(HasSubstr("must not know campaign/plan.h")));
  EXPECT_THAT(CheckIncludes(path, "#include \"campaign/statistics/b.h\"\n"), IsEmpty());
  EXPECT_THAT(CheckIncludes(path, "#include \"base/error.h\"\n"), IsEmpty());
}

TEST(CheckIncludes, IsNotFooledBySpelling) {
  EXPECT_THAT(CheckIncludes("sim/a.cc", "  #  include   \"cli/verb.h\"  // why"),
              ElementsAre(HasSubstr("sim must not know cli")));
  EXPECT_THAT(CheckIncludes("sim/a.cc", "#include <cli/verb.h>"),
              ElementsAre(HasSubstr("sim must not know cli")));
  EXPECT_THAT(CheckIncludes("sim/a.cc", "#include \"../cli/verb.h\""),
              ElementsAre(HasSubstr("not named from the root")));
  EXPECT_THAT(CheckIncludes("sim/a.cc", "// #include \"cli/verb.h\"\n"), IsEmpty());
}

TEST(CheckIncludes, KeepsThirdPartyHeadersWhereTheyAreWrapped) {
  const auto finds = [](const std::string& path, const std::string& header) {
    return CheckIncludes(path, "#include <" + header + ">\n").size() == 1;
  };
  EXPECT_TRUE(finds("sim/scene.cc", "toml++/toml.h"));
  EXPECT_FALSE(finds("data/toml_node.h", "toml++/toml.h"));
  EXPECT_TRUE(finds("data/run.cc", "hdf5.h"));
  EXPECT_FALSE(finds("data/h5_reader.cc", "hdf5.h"));
  EXPECT_TRUE(finds("measure/spot.cc", "fftw3.h"));
  EXPECT_FALSE(finds("correlate/spectrum.cc", "fftw3.h"));
  EXPECT_TRUE(finds("calib/bundle.h", "ceres/ceres.h"));
  EXPECT_FALSE(finds("calib/bundle.cc", "ceres/ceres.h"));
  EXPECT_FALSE(finds("correlate/fit.cc", "ceres/problem.h"));
  EXPECT_TRUE(finds("sim/fit.cc", "ceres/problem.h"));
  EXPECT_TRUE(finds("base/text.h", "CLI/CLI.hpp"));
  EXPECT_FALSE(finds("cli/main.cc", "CLI/CLI.hpp"));
  EXPECT_TRUE(finds("report/page.cc", "opencv2/imgcodecs.hpp"));
  EXPECT_FALSE(finds("measure/streak.cc", "opencv2/imgproc.hpp"));
  EXPECT_TRUE(finds("campaign/plan.cc", "boost/random/sobol.hpp"));
  EXPECT_FALSE(finds("campaign/statistics/sobol_sequence.cc", "boost/random/sobol.hpp"));
  EXPECT_FALSE(finds("base/probability.cc", "boost/math/special_functions/beta.hpp"));
  EXPECT_TRUE(finds("sim/a.cc", "gtest/gtest.h"));
}

TEST(CheckIncludes, LeavesTestsAndBenchesFree) {
  EXPECT_THAT(CheckIncludes("tests/sim/a_test.cc", "#include \"cli/verb.h\"\n"), IsEmpty());
  EXPECT_THAT(CheckIncludes("bench/a.cc", "#include <fftw3.h>\n"), IsEmpty());
}

TEST(CheckLinks, FindsAForbiddenArrow) {
  EXPECT_THAT(CheckLinks("sim/CMakeLists.txt",
                         "unfurl_module(sim SOURCES a.cc\n  LINKS unfurl::data unfurl::report)"),
              ElementsAre("sim/CMakeLists.txt: sim must not know report"));
  EXPECT_THAT(CheckLinks("calib/CMakeLists.txt", "LINKS unfurl::measure  # not unfurl::sim"),
              IsEmpty());
}

TEST(CheckSources, FindsTheAbsentAndTheForgotten) {
  EXPECT_THAT(CheckSources("sim/CMakeLists.txt", "unfurl_module(sim SOURCES a.cc b.cc ${c}/d.cc)",
                           {"a.cc", "a.h", "e.cc"}),
              ElementsAre("sim/CMakeLists.txt: lists b.cc, which does not exist",
                          "sim/CMakeLists.txt: does not list e.cc, so it is never built"));
  EXPECT_THAT(CheckSources("sim/CMakeLists.txt", "unfurl_module(sim SOURCES a.cc)", {"a.cc"}),
              IsEmpty());
}

TEST(CheckMachinePaths, FindsPathsOfOneMachine) {
  const std::string machine = std::string("/wo") + "rk/main";
  const std::string temporary = std::string("/t") + "mp/x";
  EXPECT_THAT(CheckMachinePaths("sim/a.cc", "// see " + machine + "\n"),
              ElementsAre(HasSubstr("sim/a.cc:1:")));
  EXPECT_THAT(CheckMachinePaths("README.md", "a\nwrites " + temporary),
              ElementsAre(HasSubstr("README.md:2:")));
  EXPECT_THAT(CheckMachinePaths("tests/a.cc", temporary), IsEmpty());
  EXPECT_THAT(CheckMachinePaths("README.md", "home" + machine), IsEmpty());
}

TEST(CheckSharedFolders, FindsFoldersThatTwoTestsCouldShare) {
  const std::string shared = "f = temp_directory_path() / \"x\"; g = getpid();";
  const std::string own = "f = temp_directory_path() /\n  (\"x\" + to_string(getpid()));";
  EXPECT_THAT(CheckSharedFolders("tests/data/a.cc", shared), ElementsAre(HasSubstr("OwnFolder")));
  EXPECT_THAT(CheckSharedFolders("tests/data/a.cc", own), IsEmpty());
  EXPECT_THAT(CheckSharedFolders("data/a.cc", shared), IsEmpty());
}

TEST(CheckOwnNamespace, FindsTestsThatShareOne) {
  const std::string text = "namespace unfurl::data::a_test {\n";
  EXPECT_THAT(CheckOwnNamespace("tests/data/a_test.cc", text), IsEmpty());
  EXPECT_THAT(CheckOwnNamespace("tests/data/b_test.cc", text), ElementsAre(HasSubstr("::b_test")));
  EXPECT_THAT(CheckOwnNamespace("tests/data/traced.cc", text), IsEmpty());
  EXPECT_THAT(CheckOwnNamespace("data/b_test.cc", text), IsEmpty());
}

TEST(CheckLength, ReportsAndFails) {
  const auto lines = [](int n) {
    std::string text;
    for (int i = 0; i < n; ++i) text += "x\n";
    return text;
  };
  bool is_long = true;
  EXPECT_THAT(CheckLength("a.cc", lines(400), &is_long), IsEmpty());
  EXPECT_FALSE(is_long);
  EXPECT_THAT(CheckLength("a.cc", lines(401), &is_long), IsEmpty());
  EXPECT_TRUE(is_long);
  EXPECT_THAT(CheckLength("a.cc", lines(500), &is_long), IsEmpty());
  EXPECT_THAT(CheckLength("a.cc", lines(501), &is_long), ElementsAre(HasSubstr("501 lines")));
}

TEST(CheckLineLengths, FindsLongLinesOfDocuments) {
  const std::string long_line = std::string(60, 'a') + " " + std::string(60, 'b');
  EXPECT_THAT(CheckLineLengths("a.md", "x\n" + long_line + "\n"),
              ElementsAre("a.md:2: 121 characters (at most 120)"));
  EXPECT_THAT(CheckLineLengths("a.cc", long_line), IsEmpty());
  EXPECT_THAT(CheckLineLengths("a.md", "| " + long_line + " |\n  | " + long_line), IsEmpty());
  EXPECT_THAT(CheckLineLengths("a.md", "  " + std::string(130, 'a')), IsEmpty());
  std::string umlauts = "a ";
  for (int i = 0; i < 118; ++i) umlauts += "\u00e4";
  EXPECT_THAT(CheckLineLengths("a.md", umlauts), IsEmpty());
}

TEST(CheckRoots, FindsThoseThatMakeNothingOfNoNumber) {
  EXPECT_THAT(CheckRoots("sim/a.cc", "int n;\nx = std::sqrt(std::max(0.0, y));\n"),
              ElementsAre("sim/a.cc:2: std::max(0.0, x) of no number is 0"));
  EXPECT_THAT(CheckRoots("sim/a.cc", "x = std::sqrt(std::max(y, 0.0)) + std::max(0.0, z);\n"),
              IsEmpty());
}

TEST(CheckConstants, FindsNumbersWithoutAReason) {
  const auto lines = [](const std::string& text, const std::string& path = "sim/a.cc") {
    return CheckConstants(path, text).size();
  };
  EXPECT_THAT(CheckConstants("sim/a.h", "int x;\ninline constexpr int kMost = 3;\n"),
              ElementsAre(HasSubstr("sim/a.h:2: a number without its reason")));
  EXPECT_EQ(lines("constexpr double kA = -.5;\n"), 1u);
  EXPECT_EQ(lines("  static constexpr int kA =\n      12;\n"), 1u);
  EXPECT_EQ(lines("constexpr double kA = kB, kC = 2.0;\n"), 1u);
  // A comment beside one says nothing of the next, nor does one that other code parts from it.
  EXPECT_EQ(lines("constexpr int kA = 1;  // [s]\nconstexpr int kB = 2;\n"), 1u);
  EXPECT_EQ(lines("// Why.\n\nconstexpr int kA = 1;\n"), 1u);
  EXPECT_EQ(lines("// Why.\nconstexpr int kA = 1;  // [s]\nconstexpr int kB = 2;\n"), 1u);
}

TEST(CheckConstants, PassesWhatHasAReason) {
  for (const char* text :
       {"constexpr int kA = 1;  // [s]\n", "// Why.\nconstexpr int kA = 1;\n",
        "/// Why.\n  inline constexpr int kA = 1,\n  kB = 2;\nconstexpr int kC = 3;\n",
        "constexpr int kA = 1,  // why\n    kB = 2;\n", "inline constexpr int kRunVersion = 3;\n",
        "constexpr int kA = kB;\n", "constexpr char kA[] = \"2\";\n",
        "constexpr int Twice(int a) { return 2 * a; }\n",
        "constexpr std::array<int, 2> kA = {{1, 2}};\n", "int a = 3;\n"}) {
    EXPECT_THAT(CheckConstants("sim/a.cc", text), IsEmpty()) << text;
  }
  EXPECT_THAT(CheckConstants("tests/sim/a.cc", "constexpr int kA = 1;\n"), IsEmpty());
}

TEST(CheckHeader, WantsAGuard) {
  EXPECT_THAT(CheckHeader("a.h", "int x;\n"), ElementsAre(HasSubstr("#pragma once")));
  EXPECT_THAT(CheckHeader("a.h", "#pragma once\n"), IsEmpty());
  EXPECT_THAT(CheckHeader("a.cc", "int x;\n"), IsEmpty());
}

TEST(LinksOf, FindsWhatCanBeChecked) {
  EXPECT_THAT(LinksOf("see [a](docs/a.md#part), ![b](b.png), [c](#here) and [d](mailto:e@f)"),
              ElementsAre("docs/a.md", "b.png"));
  EXPECT_THAT(LinksOf("f[i](x y)"), IsEmpty());
}

TEST(CheckPackages, WantsARowForEach) {
  EXPECT_THAT(CheckPackages("packages-test.txt", "# words\ncmake\nlibx-dev  # for y\n",
                            "| `cmake` | builds |"),
              ElementsAre(HasSubstr("packages-test.txt:3: libx-dev")));
}

}  // namespace
}  // namespace unfurl::structure::house_test
