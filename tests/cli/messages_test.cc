// What a person is told who gave the wrong file, misspelt a word or asked for nothing: by the real
// program, one line.
#include <gmock/gmock.h>

#include "tests/cli/program.h"

namespace unfurl::cli::messages_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Messages : public ProgramTest {
 protected:
  // The text of a start as `unfurl new` makes it, with one thing changed.
  std::string Changed(const std::string& from, const std::string& what,
                      const std::string& by) const {
    std::string text = Get(from);
    const std::size_t at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return text.replace(at, what.size(), by);
  }
};

TEST_F(Messages, ATomlOfAnotherKindIsNamed) {
  for (const char* start : {"boom", "rig", "study", "campaign", "trial"}) {
    ASSERT_EQ(Run({"new", start}).code, 0);
  }
  const std::vector<std::string> before = Files();
  const std::string scene = "boom/scene.toml", lab = "rig/lab.toml", study = "study/study.toml",
                    plan = "campaign/plan.toml", lines = "trial/lines.toml";
  struct Case {
    std::vector<std::string> command;
    std::string file, is, wanted;
  };
  for (const Case& c : std::vector<Case>{
           {{"simulate", lab}, lab, "a laboratory", "a scene"},
           {{"modes", plan}, plan, "a campaign's plan", "a scene"},
           {{"plan", scene}, scene, "a scene", "a laboratory"},
           {{"fit", scene}, scene, "a scene", "a study"},
           {{"design", plan}, plan, "a campaign's plan", "a study"},
           {{"campaign", study}, study, "a study", "a campaign's plan"},
           {{"convert", lab, "trial.h5"}, lab, "a laboratory", "a description of raw lines"},
           {{"simulate", lines}, lines, "a description of raw lines", "a scene"}}) {
    SCOPED_TRACE(c.command[0] + " " + c.command[1]);
    ExpectRefused(Run(c.command), {c.file, "is " + c.is, "where " + c.wanted + " is needed"},
                  before);
  }
}

TEST_F(Messages, AMisspeltTableIsNamedWithTheOneThatWasMeant) {
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  Put("a.toml", Changed("boom/scene.toml", "[scene]", "[scen]"));
  Put("b.toml", Changed("boom/scene.toml", "[beam.inner]", "[baem.inner]"));
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"simulate", "a.toml"}), {"a.toml", "[scene] is missing", "[scene] by [scen]"},
                before);
  ExpectRefused(Run({"simulate", "b.toml"}), {"b.toml", "inner", "did you mean [beam] by [baem]?"},
                before);
}

TEST_F(Messages, AnHdf5WhereTextIsReadIsNamed) {
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  ASSERT_EQ(Run({"simulate", "boom/scene.toml", "--duration", "0.01", "-o", "run.h5"}).code, 0);
  const std::vector<std::string> before = Files();
  // Beside its own default output, too, which has the same name.
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"simulate", "run.h5"},
                                             {"simulate", "run.h5", "-o", "other.h5"},
                                             {"fit", "run.h5"},
                                             {"effects", "run.h5", "--sigma", "0.2mm"},
                                             {"campaign", "run.h5"}}) {
    SCOPED_TRACE(command[0]);
    ExpectRefused(Run(command), {"run.h5", "is a run", "where TOML is read"}, before);
  }
}

TEST_F(Messages, WordsAndNumbersOfACampaign) {
  ASSERT_EQ(Run({"new", "campaign"}).code, 0);
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"campaign", "rum", "campaign/plan.toml"}),
                {"not expected", "did you mean `unfurl campaign run`?"}, before);
  ExpectRefused(Run({"campaign", "campaign/plan.toml", "--runs", "0"}), {"--runs", "above 0"},
                before);
}

// Springs that act at once on straight panels: the finer the mesh, the larger the first pin force.
TEST_F(Messages, APinForceOfTheStartIsTheMeshs) {
  ASSERT_EQ(Run({"new", "wing"}).code, 0);
  const std::vector<std::string> run = {"simulate", "wing/scene.toml", "--duration", "0.01"};
  constexpr char kWords[] = "a pin force that is largest at 0 s is the mesh's";
  EXPECT_THAT(Run(run).out, HasSubstr(kWords));
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  EXPECT_THAT(Run({"simulate", "boom/scene.toml", "--duration", "1.2"}).out,
              Not(HasSubstr(kWords)));
}

TEST_F(Messages, TooFewAndTooManyWords) {
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"doctor", "x", "y"}), {"'x' and 'y' are not expected", "unfurl doctor --help"},
                before);
  ExpectRefused(Run({"simulate", "a.toml", "b.toml"}), {"'b.toml' is not expected"}, before);
  ExpectRefused(Run({"completion", "bash", "-o", "x"}), {"has no option -o"}, before);
  ExpectRefused(Run({"check", "rig.h5"}), {"READINGS is required: a survey of some points"},
                before);
  ExpectRefused(Run({"simulate", "a.toml", "--rate"}), {"--rate needs a value: samples per second"},
                before);
}

TEST_F(Messages, NamesOfFiles) {
  Put("a_file", "");
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  ASSERT_EQ(Run({"simulate", "boom/scene.toml", "--duration", "0.1", "-o", "run.h5"}).code, 0);
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"correlate", "run.h5", "run.h5", "--figures", "a_file"}),
                {"a_file", "is a file, where a folder is to be made", "--figures"}, before);
  ExpectRefused(Run({"reconstruct", "run.h5", "--rig", "run.h5", "--picture", "x.jpg"}),
                {"x.jpg", "--picture writes .png"}, before);
  ExpectRefused(Run({"convert", "nowhere.toml", "x.csv"}), {"nowhere.toml", "no such file"},
                before);
  ExpectRefused(Run({"effects", "boom/scene.toml", "--sigma", "0.2mm", "-o", "x.h5"}),
                {"x.h5", "--output writes .toml"}, before);
}

TEST_F(Messages, ATimeBeyondTheRecordIsRefusedWithItsSpan) {
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  ASSERT_EQ(Run({"simulate", "boom/scene.toml", "--duration", "0.5", "-o", "run.h5"}).code, 0);
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"correlate", "run.h5", "--from", "99"}), {"--from", "99 s", "0 to 0.5 s"},
                before);
  ExpectRefused(Run({"correlate", "run.h5", "--to", "-1"}), {"--to", "-1 s", "0 to 0.5 s"}, before);
  ExpectRefused(Run({"correlate", "run.h5", "run.h5", "--from", "99"}), {"--from", "share"},
                before);
}

TEST_F(Messages, TablesAsSpreadsheetsSaveThem) {
  const std::string head = "t [s],tip [mm]\n", rows = "0,1\n0.1,2\n0.2,3\n";
  const auto described = [&](const std::string& text) {
    Put("table.csv", text);
    const Outcome outcome = Run({"info", "table.csv"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string wanted = described(head + rows);
  EXPECT_THAT(wanted, HasSubstr("3 rows"));
  EXPECT_EQ(described(head + "0,1\n,\n0.1,2\n0.2,3\n,\n,\n"), wanted);  // emptied rows
  std::string returns = head + rows;
  for (char& c : returns) c = c == '\n' ? '\r' : c;
  EXPECT_EQ(described(returns), wanted);
  EXPECT_THAT(described(head + "0,1\n"), HasSubstr("1 row\n"));
}

TEST_F(Messages, ColumnsOfReadingsInCapitalsAreToRename) {
  ASSERT_EQ(Run({"new", "rig"}).code, 0);
  for (const auto& [name, other] :
       {std::pair{"u1 [px]", "U1 [px]"}, std::pair{"u3 [px]", "U3 [px]"}}) {
    Put("survey.csv",
        Changed("rig/survey_template.csv", std::string(",") + name, std::string(",") + other));
    const Outcome outcome = Run({"calibrate", "survey.csv"});
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err,
                HasSubstr(std::string("rename the column '") + other[0] + other[1] + "'"));
  }
}

TEST_F(Messages, TracksOutOfOrderAreNamedByTheirFile) {
  ASSERT_EQ(Run({"new", "study"}).code, 0);
  ASSERT_EQ(Run({"simulate", "study/scene.toml", "--duration", "0.1", "-o", "run.h5"}).code, 0);
  // The first two samples of a mark change places.
  std::string text = Get("study/tracks.csv");
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    lines.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  std::size_t first = 0, second = 0;
  for (std::size_t i = 0; i < lines.size() && second == 0; ++i) {
    if (lines[i].find(",tip,") == std::string::npos) continue;
    (first == 0 ? first : second) = i;
  }
  ASSERT_GT(second, first);
  std::swap(lines[first], lines[second]);
  text.clear();
  for (const std::string& line : lines) text += line + "\n";
  Put("mixed.csv", text);
  const Outcome outcome = Run({"correlate", "mixed.csv", "run.h5"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("mixed.csv: the stamps of tip do not ascend"));
}

// One of a thing is one thing.
TEST_F(Messages, SingularsAreSingular) {
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  const Outcome run = Run({"simulate", "boom/scene.toml", "--duration", "1e-9", "-o", "run.h5"});
  ASSERT_EQ(run.code, 0);
  EXPECT_THAT(run.out, HasSubstr("1 step ("));
  EXPECT_THAT(run.out, HasSubstr("1 sample,"));
  Put("one.csv", "t [s],a [m/s^2]\n0.1,2\n");
  EXPECT_THAT(Run({"correlate", "one.csv"}).out, HasSubstr("1 channel,"));
  Put("cells.csv", "t [s],a [m/s^2]\n0.1\n");
  EXPECT_THAT(Run({"correlate", "cells.csv"}).err, HasSubstr("1 cell,"));
  ASSERT_EQ(Run({"modes", "boom/scene.toml", "--count", "1", "--report", "m.html"}).code, 0);
  EXPECT_THAT(Get("m.html"), HasSubstr("1 mode, "));
}

TEST_F(Messages, AnEmptyFileIsCalledEmpty) {
  for (const char* name : {"empty.toml", "empty.csv", "empty.h5"}) Put(name, "");
  const std::vector<std::string> before = Files();
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"simulate", "empty.toml", "-o", "run.h5"},
                                             {"plan", "empty.toml"},
                                             {"fit", "empty.toml", "-o", "fit.h5"},
                                             {"calibrate", "empty.csv"},
                                             {"correlate", "empty.csv"},
                                             {"calibrate", "empty.h5"},
                                             {"reconstruct", "empty.h5", "--rig", "empty.h5"}}) {
    SCOPED_TRACE(command[0] + " " + command[1]);
    ExpectRefused(Run(command), {command[1] + ": is empty; "}, before);
  }
}

// Leaving "ms" out of "500ms" would make 500 s of it.
TEST_F(Messages, AUnitBehindANumberIsConverted) {
  ASSERT_EQ(Run({"new", "boom"}).code, 0);
  const std::string scene = "boom/scene.toml";
  const std::vector<std::string> before = Files();
  ExpectRefused(Run({"simulate", scene, "--duration", "500ms"}), {"'500ms'", "write 0.5: seconds"},
                before);
  ExpectRefused(Run({"check", scene, scene, "--bar", "750 feet"}),
                {"--bar", "'750 feet' is no length"}, before);
  ExpectRefused(Run({"simulate", scene, "--duration", "5s"}), {"leave 's' out"}, before);
  ExpectRefused(Run({"modes", scene, "--count", "three"}), {"it is: how many modes"}, before);
  ExpectRefused(Run({"simulate", scene, "--set", "joint.hinge.latch.theta_a=5deg"}),
                {"holds '5deg', not a number; write it without a unit"}, before);
}

TEST_F(Messages, HelpSaysKindsOfValuesInWords) {
  for (const char* verb : {"plan", "calibrate", "cost", "campaign", "reconstruct"}) {
    const std::string help = Run({verb, "--help"}).out;
    for (const char* of_the_parser : {":POSITIVE", ":NONNEGATIVE", " in [", "UINT", ":{"}) {
      EXPECT_THAT(help, Not(HasSubstr(of_the_parser))) << verb;
    }
  }
  EXPECT_THAT(Run({"calibrate", "--help"}).out, HasSubstr("--folds INTEGER from 2 to 1000=10"));
}

}  // namespace
}  // namespace unfurl::cli::messages_test
