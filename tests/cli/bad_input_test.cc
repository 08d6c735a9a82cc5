// Bad input through the real program: the documented exit code, one line that names the file, the
// key and the remedy, and no output file left behind.
#include <gmock/gmock.h>
#include <sys/mount.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/cli/program.h"
#include "tests/source_dir.h"

namespace unfurl::cli::bad_input_test {
namespace {

using ::testing::HasSubstr;

class BadInput : public ProgramTest {
 protected:
  // A run so short that making it costs nothing.
  void MakeRun(const std::string& name) const {
    const Outcome made =
        Run({"simulate", Shipped("scene_suspension.toml"), "--duration", "0.02", "--set",
             "beam.beam1.segments=2", "--set", "beam.beam2.segments=2", "--set",
             "beam.beam3.segments=2", "--set", "beam.beam4.segments=2", "-o", name});
    ASSERT_EQ(made.code, 0) << made.err;
  }
};

TEST_F(BadInput, MissingFile) {
  ExpectRefused(Run({"simulate", "nowhere.toml"}), {"nowhere.toml", "check the name"}, {});
  ExpectRefused(Run({"info", "nowhere.h5"}), {"nowhere.h5", "no such file", "check the name"}, {});
  ExpectRefused(Run({"calibrate", "nowhere.csv"}), {"nowhere.csv", "check the name"}, {});
  ExpectRefused(Run({"fit", "nowhere.toml"}), {"nowhere.toml", "check the name"}, {});
}

// What a document names is refused at the place that names it.
TEST_F(BadInput, MissingFileThatADocumentNames) {
  std::filesystem::copy_file(Shipped("scene_suspension.toml"), folder_ / "scene.toml");
  const std::string parameter =
      "[parameter.k]\nkeys = [\"beam.beam1.damping\"]\nstart = 1.0\nbounds = [0.1, 9.0]\n";
  const std::string job =
      "[variable.k]\nkeys = [\"beam.beam1.damping\"]\nuniform = [1.0, 2.0]\n[job]\n";
  const std::string rest = "[response.r]\nquantity = \"j.theta\"\nof = \"final\"\n";
  struct Case {
    const char* verb;
    std::string text, where, file;
  };
  for (const Case& c : std::vector<Case>{
           {"fit", "[study]\nscene = \"s.toml\"\n[trial]\ntracks = \"t.h5\"\n" + parameter,
            "study.toml:2:study.scene", "s.toml"},
           {"effects", "[study]\nscene = \"s.toml\"\n[trial]\ntracks = \"t.h5\"\n" + parameter,
            "study.toml:2:study.scene", "s.toml"},
           {"fit", "[study]\nscene = \"scene.toml\"\n[trial]\ntracks = \"t.h5\"\n" + parameter,
            "study.toml:4:trial.tracks", "t.h5"},
           {"fit",
            "[study]\nscene = \"scene.toml\"\n[trial.channel.c]\nfile = \"c.csv\"\n"
            "quantity = \"joint.joint1.theta\"\n" +
                parameter,
            "study.toml:3:trial.channel.c", "c.csv"},
           {"campaign", "[campaign]\nruns = 4\n" + job + "scene = \"s.toml\"\n" + rest,
            "study.toml:6:job.scene", "s.toml"}}) {
    Put("study.toml", c.text);
    ExpectRefused(Run({c.verb, "study.toml"}),
                  {c.where, "there is no file '" + c.file + "'", "check the name"},
                  {"scene.toml", "study.toml"});
  }
}

TEST_F(BadInput, NotHdf5) {
  Put("text.h5", "this is no HDF5 file");
  for (const auto& command :
       std::vector<std::vector<std::string>>{{"reconstruct", "text.h5", "--rig", "text.h5"},
                                             {"expose", "text.h5", "--lab", Shipped("lab.toml")},
                                             {"correlate", "text.h5", "text.h5"},
                                             {"info", "text.h5"},
                                             {"convert", "text.h5", "out.csv"}}) {
    ExpectRefused(Run(command), {"text.h5", "is not an HDF5 file", "give"}, {"text.h5"});
  }
}

TEST_F(BadInput, WrongSchema) {
  MakeRun("run.h5");
  ExpectRefused(Run({"reconstruct", "run.h5", "--rig", "run.h5"}),
                {"run.h5", "is a run", "where a trial", "is needed", "unfurl info"}, {"run.h5"});
  ExpectRefused(Run({"calibrate", "run.h5"}), {"run.h5", "where a survey", "is needed"},
                {"run.h5"});
}

// Each was found after the run, or not at all: a page into no folder, a name that a shell left
// empty, HDF5 under the name of another form.
TEST_F(BadInput, OutputsAreLookedAtBeforeTheWork) {
  const std::string scene = Shipped("scene_suspension_4.toml");
  struct Case {
    std::vector<std::string> outputs, words;
  };
  for (const Case& c : std::vector<Case>{
           {{"--report", "none/x.html"}, {"none/x.html", "no such folder", "--report"}},
           {{"--report", "."}, {"is a folder", "--report"}},
           {{"--report", "x.pdf"}, {"x.pdf", "writes HTML", "--pdf"}},
           {{"--report", ""}, {"--report", "empty"}},
           {{"-o", ""}, {"--output", "empty"}},
           {{"-o", "x.csv"}, {"x.csv", "writes .h5", "unfurl convert"}}}) {
    std::vector<std::string> command = {"simulate", scene, "--duration", "0.01"};
    command.insert(command.end(), c.outputs.begin(), c.outputs.end());
    ExpectRefused(Run(command), c.words, {});
  }
}

// CLI11 takes -1 for the largest whole number, and prints the largest number that there is.
TEST_F(BadInput, NumbersThatAnOptionCannotTake) {
  struct Case {
    std::vector<std::string> command, words;
  };
  for (const Case& c : std::vector<Case>{
           {{"calibrate", "s.csv", "--workers", "-1"}, {"--workers", "from 0", "-1"}},
           {{"calibrate", "s.csv", "--sigma", "1mm"}, {"--sigma takes a number", "write 0.001"}},
           {{"calibrate", "s.csv", "--sigma", "-1"}, {"--sigma cannot be -1", "above 0"}},
           {{"calibrate", "s.csv", "--folds", "1"}, {"--folds cannot be 1", "2 to 1000"}},
           {{"plan", Shipped("lab.toml"), "--need", "0.5"}, {"--need", "with its unit"}},
           {{"effects", Shipped("scene_suspension.toml"), "--sigma", "0.2"},
            {"--sigma", "with its unit"}},
           {{"simulate", "s.toml", "-rate", "3"}, {"no option -rate", "did you mean --rate?"}}}) {
    const Outcome outcome = Run(c.command);
    ExpectRefused(outcome, c.words, {});
    EXPECT_LT(outcome.err.size(), 400u);
  }
}

// As spreadsheets save them.
TEST_F(BadInput, TablesOfSpreadsheets) {
  Put("utf16.csv", std::string("\xff\xfei\0d\0", 6));
  Put("bare.csv", "0.1,0.2,0.3\n0.4,0.5,0.6\n");
  Put("comma.csv", "id,x [m],\nA,1,\n");
  Put("capitals.csv", "ID,x [m]\nA,1\n");
  const std::vector<std::string> all = {"bare.csv", "capitals.csv", "comma.csv", "utf16.csv"};
  const std::vector<std::vector<std::string>> words = {{"bare.csv:1", "holds numbers", "names"},
                                                       {"no column 'id'", "rename the column 'ID'"},
                                                       {"comma.csv:1", "comma at the end"},
                                                       {"UTF-16", "UTF-8"}};
  for (std::size_t k = 0; k < all.size(); ++k) {
    ExpectRefused(Run({"calibrate", all[k]}), words[k], all);
  }
}

TEST_F(BadInput, TruncatedFile) {
  MakeRun("run.h5");
  const std::string whole = Get("run.h5");
  for (const double part : {0.3, 0.9, 0.999}) {
    Put("run.h5",
        whole.substr(0, static_cast<std::size_t>(part * static_cast<double>(whole.size()))));
    ExpectRefused(Run({"expose", "run.h5", "--lab", Shipped("lab.toml")}),
                  {"run.h5", "truncated", "copy it again"}, {"run.h5"});
  }
}

TEST_F(BadInput, DamagedInside) {
  MakeRun("run.h5");
  std::string whole = Get("run.h5");
  for (std::size_t at = 200; at < whole.size(); at += 97) whole[at] = static_cast<char>(0xff);
  Put("run.h5", whole);
  const Outcome outcome = Run({"convert", "run.h5", "run.csv"});
  ExpectRefused(outcome, {"run.h5"}, {"run.h5"});
}

TEST_F(BadInput, UnknownKey) {
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "--set", "body.hub.mas=3"}),
                {"body.hub.mas", "unknown key", "did you mean 'mass'?"}, {});
  Put("scene.toml", "[scene]\nname = 'x'\nduration = 1.0\n[bodi.a]\nmass = 1.0\n");
  ExpectRefused(Run({"simulate", "scene.toml"}), {"scene.toml:4:bodi", "did you mean 'body'?"},
                {"scene.toml"});
}

TEST_F(BadInput, NegativeMass) {
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "--set", "body.hub.mass=-36"}),
                {"body.hub.mass", "-36", "above 0"}, {});
}

TEST_F(BadInput, LoopThatCannotClose) {
  // Four bars of 1 m between pins 10 m apart.
  std::string scene = "[scene]\nname = 'four-bar'\nduration = 1.0\n";
  for (const char* bar : {"a", "b", "c"}) {
    scene += std::string("[body.") + bar + "]\nmass = 1.0\ninertia = 0.1\n";
  }
  const auto joint = [&](const char* name, const char* inner, const char* inner_point,
                         const char* outer, const char* outer_point) {
    scene += std::string("[joint.") + name + "]\ninner = '" + inner +
             "'\ninner_point = " + inner_point + "\nouter = '" + outer +
             "'\nouter_point = " + outer_point + "\n";
  };
  joint("left", "ground", "[0.0, 0.0]", "a", "[-0.5, 0.0]");
  joint("elbow", "a", "[0.5, 0.0]", "b", "[-0.5, 0.0]");
  joint("wrist", "b", "[0.5, 0.0]", "c", "[-0.5, 0.0]");
  joint("right", "ground", "[10.0, 0.0]", "c", "[0.5, 0.0]");
  scene += "[mark.m]\non = 'b'\n";
  Put("scene.toml", scene);
  ExpectRefused(Run({"simulate", "scene.toml"}), {"scene.toml", "right", "clos"}, {"scene.toml"});
}

TEST_F(BadInput, SurveyWithoutUnits) {
  Put("survey.csv",
      "id,x,y,z,sx,sy,sz,u1,u2,u3,u4,s1,s2,s3,s4\nA,1,2,3,.1,.1,.1,5,5,5,5,1,1,1,1\n");
  ExpectRefused(Run({"calibrate", "survey.csv"}), {"survey.csv", "'x' has no unit", "'x [m]'"},
                {"survey.csv"});
}

TEST_F(BadInput, RigThatDoesNotMatchTheTrial) {
  MakeRun("run.h5");
  ASSERT_EQ(Run({"expose", "run.h5", "--lab", Shipped("lab.toml"), "-o", "trial.h5"}).code, 0);
  // The same survey with its cameras under other names gives a rig for another trial.
  ASSERT_EQ(Run({"convert", Shipped("survey.h5"), "survey.csv"}).code, 0);
  std::string survey = Get("survey.csv");
  const std::size_t name = survey.find("north_east");
  ASSERT_NE(name, std::string::npos);
  Put("survey.csv", survey.replace(name, 10, "by_the_door"));
  ASSERT_EQ(Run({"calibrate", "survey.csv", "-o", "rig.h5"}).code, 0);
  const auto before = Files();
  ExpectRefused(Run({"reconstruct", "trial.h5", "--rig", "rig.h5"}), {"trial.h5", "camera"},
                before);
}

TEST_F(BadInput, OutputFolderThatIsNotThere) {
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "-o", "no/where/run.h5"}),
                {"no/where", "no such folder", "-o"}, {});
}

// What ran and cannot be used says so in one line, however little is to be printed.
TEST_F(BadInput, ResultThatCannotBeUsed) {
  Put("two.csv",
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2]\n"
      "0,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n0.1,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n");
  for (const std::vector<std::string>& how :
       std::vector<std::vector<std::string>>{{}, {"--quiet"}, {"--json"}, {"--json", "--quiet"}}) {
    for (std::vector<std::string> command : std::vector<std::vector<std::string>>{
             {"correlate", "two.csv", "two.csv"},
             {"plan", Shipped("lab.toml"), "--reading-sigma", "30"}}) {
      command.insert(command.end(), how.begin(), how.end());
      const Outcome outcome = Run(command);
      EXPECT_EQ(outcome.code, 1) << command[0] << outcome.err;
      EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    }
  }
}

TEST_F(BadInput, CommandLine) {
  ExpectRefused(Run({"simulat", "x.toml"}), {"command line", "--help"}, {});
  ExpectRefused(Run({"simulate"}), {"command line", "--help"}, {});
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "--rtol", "zero"}), {"rtol"}, {});
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "--rtol", "0"}), {"rtol"}, {});
  ExpectRefused(Run({"simulate", Shipped("scene_clearance.toml"), "--rtol", "nan"}), {"rtol"}, {});
}

TEST_F(BadInput, FullDisk) {
  // Every write past 20 kB of one file fails, whatever the file system.
  const Outcome limited = RunProgram(
      {"simulate", Shipped("scene_suspension.toml"), "--duration", "0.5", "-o", "run.h5"}, folder_,
      20000);
  ExpectRefused(limited, {"run.h5", "cannot write", "free some space"}, {}, 4);
}

TEST_F(BadInput, FullFileSystem) {
  const std::filesystem::path small = folder_ / "small";
  std::filesystem::create_directory(small);
  if (mount("tmpfs", small.c_str(), "tmpfs", 0, "size=64k") != 0) {
    GTEST_SKIP() << "only root can mount a small file system; FullDisk covers the same path";
  }
  const Outcome full = Run(
      {"simulate", Shipped("scene_suspension.toml"), "--duration", "0.5", "-o", "small/run.h5"});
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(small), {}), 0);
  umount(small.c_str());
  ExpectRefused(full, {"small/run.h5", "would take", "the disk has 6", "-o"}, {"small"}, 4);
}

// HDF5 1.10.8 frees what it never set where an attribute is damaged; a newer one says what is
// wrong.
TEST_F(BadInput, AFileThatBreaksTheLibraryWhichReadsIt) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "whose own handler comes first";
#endif
  constexpr std::size_t kBit = 8836;
  std::ifstream stream(UNFURL_SOURCE_DIR "/tests/fuzz/foreign/trial.h5", std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  bytes.at(kBit / 8) = static_cast<char>(bytes[kBit / 8] ^ (1 << (kBit % 8)));
  Put("trial.h5", bytes);
  ExpectRefused(Run({"info", "trial.h5"}), {"trial.h5", "copy"}, {"trial.h5"});
}

}  // namespace
}  // namespace unfurl::cli::bad_input_test
