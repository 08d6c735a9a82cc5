// The first minutes: starts that run as they are, and what a mistyped command line is told.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/cli/program.h"

namespace unfurl::cli::new_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

std::vector<std::string> WordsOf(const std::string& command) {
  std::istringstream stream(command);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  words.erase(words.begin());  // "unfurl"
  return words;
}

class Starts : public ProgramTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(Starts, RunAsTheyAre) {
  const Outcome made = Run({"new", GetParam(), "mine", "--json"});
  ASSERT_EQ(made.code, 0) << made.err;
  const json summary = json::parse(made.out);
  for (const std::string file : summary["files"]) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "mine" / file)) << file;
  }
  for (const std::string command : summary["commands"]) {
    const Outcome outcome = RunProgram(WordsOf(command), folder_ / "mine");
    EXPECT_EQ(outcome.code, 0) << command << "\n" << outcome.err;
  }
}
INSTANTIATE_TEST_SUITE_P(Kinds, Starts, ::testing::Values("boom", "rig", "trial", "campaign"));

class New : public ProgramTest {};

TEST_F(New, WingOpens) {
  ASSERT_EQ(Run({"new", "wing"}).code, 0);
  const Outcome outcome = Run({"simulate", "wing/scene.toml", "-o", "wing.h5", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["status"], "good");
  for (const char* joint : {"root", "hinge1", "hinge2", "hinge3"}) {
    EXPECT_THAT(Run({"info", "wing.h5"}).out, HasSubstr(std::string(joint) + ".latch_time"));
  }
}

// The README of the study says what its record was made with.
TEST_F(New, TheStudyFindsWhatItsRecordWasMadeWith) {
  ASSERT_EQ(Run({"new", "study"}).code, 0);
  const Outcome outcome = RunProgram({"fit", "study.toml", "--json"}, folder_ / "study");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json fit = json::parse(outcome.out);
  const std::map<std::string, double> truth = {
      {"friction", 0.072}, {"clearance", 0.0061}, {"damping", 3.1e-4}};
  ASSERT_EQ(fit["parameters"].size(), truth.size());
  for (const json& parameter : fit["parameters"]) {
    const double value = truth.at(parameter["name"]);
    EXPECT_LT(parameter["low95"].get<double>(), value) << parameter["name"];
    EXPECT_GT(parameter["high95"].get<double>(), value) << parameter["name"];
  }
}

TEST_F(New, ReplacesNothing) {
  std::filesystem::create_directory(folder_ / "boom");
  Put("boom/README.md", "mine");
  const Outcome outcome = Run({"new", "boom"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("boom/README.md: is there already, and stays"));
  EXPECT_EQ(Get("boom/README.md"), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "boom/scene.toml"));
  const Outcome file = Run({"new", "boom", "boom/README.md"});
  EXPECT_EQ(file.code, 2);
  EXPECT_THAT(file.err, HasSubstr("boom/README.md: is a file, where a folder is to be made"));
  EXPECT_EQ(Run({"new", "boom", "other/place"}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "other/place/scene.toml"));
}

struct Mistake {
  std::vector<std::string> arguments;
  std::string words;
};

void PrintTo(const Mistake& mistake, std::ostream* to) {
  *to << ::testing::PrintToString(mistake.arguments);
}

class Mistakes : public ProgramTest, public ::testing::WithParamInterface<Mistake> {};

TEST_P(Mistakes, AreToldWithWhatWasMeant) {
  ASSERT_EQ(Run({"new", "boom", "."}).code, 0);
  std::ofstream(folder_ / "file.h5", std::ios::binary) << "\x89HDF\r\n\x1a\n" << '\0' << "rest";
  const std::vector<std::string> before = Files();
  ExpectRefused(Run(GetParam().arguments), {GetParam().words}, before);
}

const Mistake kMistakes[] = {
    {{"simulat", "scene.toml"}, "there is no verb 'simulat'; did you mean `unfurl simulate`?"},
    {{"frobnicate"}, "see `unfurl --help`"},
    {{"help", "callibrate"}, "did you mean `unfurl calibrate`?"},
    {{"simulate", "scene.toml", "--dration", "2"}, "did you mean --duration?"},
    {{"--dration"}, "no option --dration before the verb"},
    {{"simulate", "scene.toml", "--duration", "5s"},
     "--duration takes a number, not '5s'; leave 's' out"},
    {{"cost", "scene.toml", "--segments", "4-8"}, "'4-8'; write each, with commas: 4,8"},
    {{"simulate", "scene.toml", "--set", "beam.iner.length=2"}, "did you mean 'beam.inner'?"},
    {{"simulate", "scene.toml", "--set", "joint.hing.theta=2"}, "did you mean 'joint.hinge'?"},
    {{"simulate", "scene.toml", "--set", "beam.zzz.length=2"}, "beam has inner and outer"},
    {{"simulate", "scene.toml", "--set", "beam.inner.lenght=2"}, "did you mean 'length'?"},
    {{"simulate", "file.h5", "-o", "run.h5"}, "is an HDF5 file, where TOML is read"},
    {{"new", "bom"}, "did you mean 'boom'?"},
    {{"new", "spaceship"}, "known: boom, wing, rig, trial, study and campaign"},
    {{"completion", "tcsh"}, "known: bash, zsh, fish"},
};
INSTANTIATE_TEST_SUITE_P(Typed, Mistakes, ::testing::ValuesIn(kMistakes));

TEST_F(New, HelpAndVersionAsPeopleTypeThem) {
  const Outcome help = Run({"help"}), of_verb = Run({"help", "simulate"}), version = Run({"-v"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, HasSubstr("unfurl new boom"));
  EXPECT_EQ(of_verb.code, 0);
  EXPECT_THAT(of_verb.out, HasSubstr("--duration"));
  EXPECT_EQ(version.out, Run({"--version"}).out);
}

// Every verb and option of --help is in the manual and in the completion of each shell.
TEST_F(New, CompletionAndManualHoldAllOfHelp) {
  ASSERT_EQ(Run({"completion", "--into", "share"}).code, 0);
  const std::string bash = Get("share/bash-completion/completions/unfurl"),
                    zsh = Get("share/zsh/vendor-completions/_unfurl"),
                    fish = Get("share/fish/vendor_completions.d/unfurl.fish");
  for (const std::string verb : {"simulate", "fit", "new", "doctor"}) {
    const std::string page = Get("share/man/man1/unfurl-" + verb + ".1");
    std::istringstream help(Run({"help", verb}).out);
    int options = 0;
    for (std::string line; std::getline(help, line);) {
      const std::size_t at = line.find("--");
      if (!line.starts_with("  -") || at == std::string::npos) continue;
      const std::string name = line.substr(at, line.find_first_of(" =,", at) - at);
      ++options;
      EXPECT_THAT(bash, HasSubstr(name)) << verb;
      EXPECT_THAT(zsh, HasSubstr(name + "[")) << verb;
      EXPECT_THAT(fish, HasSubstr("-l " + name.substr(2))) << verb;
      std::string in_roff;
      for (const char c : name) in_roff += c == '-' ? std::string("\\-") : std::string(1, c);
      EXPECT_THAT(page, HasSubstr(in_roff)) << verb;
    }
    EXPECT_GE(options, 2) << verb;
    EXPECT_THAT(Get("share/man/man1/unfurl.1"), HasSubstr("unfurl\\-" + verb));
  }
  EXPECT_EQ(std::system(fmt::format("bash -n {}", (folder_ / "share/bash-completion/completions/"
                                                             "unfurl")
                                                      .string())
                            .c_str()),
            0);
}

TEST_F(New, DoctorSaysWhatIsThere) {
  const Outcome outcome = Run({"doctor", "--json"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const json summary = json::parse(outcome.out);
  EXPECT_TRUE(summary["usable"].get<bool>());
  EXPECT_GE(summary["findings"].size(), 6U);
}

// A folder where nobody, root neither, may make a file.
TEST_F(New, DoctorSaysInOneLineWhatLacks) {
  setenv("TMPDIR", "/proc", 1);
  const Outcome outcome = Run({"doctor", "--quiet"});
  unsetenv("TMPDIR");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err,
            "unfurl: temporary folder: /proc takes no file; set TMPDIR to a folder that does\n");
  setenv("TMPDIR", (folder_ / "none").c_str(), 1);
  EXPECT_EQ(Run({"doctor"}).code, 0);  // /tmp serves
  unsetenv("TMPDIR");
}

// What lies in the temporary folder by any name that it could choose is not written, nor imported.
TEST_F(New, DoctorLeavesTheTemporaryFolderAlone) {
  const std::filesystem::path temporary = folder_ / "tmp";
  std::filesystem::create_directories(temporary);
  Put("tmp/unfurl.py", "open('ran', 'w')\n__version__ = 'of a stranger'\n");
  setenv("TMPDIR", temporary.c_str(), 1);
  const Outcome outcome = Run({"doctor"});
  unsetenv("TMPDIR");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out.find("stranger"), std::string::npos);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(temporary),
                          std::filesystem::directory_iterator()),
            1);
}

}  // namespace
}  // namespace unfurl::cli::new_test
