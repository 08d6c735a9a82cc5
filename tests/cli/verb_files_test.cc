// No input is ever destroyed: every verb, every option that names a file, as `--help` lists them.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <map>
#include <sstream>
#include <thread>

#include "data/provenance.h"
#include "tests/cli/program.h"

namespace unfurl::cli::verb_files_test {
namespace {

using ::testing::HasSubstr;

// An option that is a file, or a positional argument.
struct FileOption {
  std::string name;
  bool positional() const { return !name.starts_with("-"); }
};

struct VerbOptions {
  std::vector<FileOption> inputs, outputs;
};

class VerbFilesTest : public ProgramTest {
 protected:
  // All verbs, by the program's own help: a new one is tested from the day it is there.
  std::vector<std::string> Verbs() const {
    std::istringstream help(Run({"--help"}).out);
    std::vector<std::string> verbs;
    bool listed = false;
    for (std::string line; std::getline(help, line);) {
      if (line.starts_with("Subcommands:")) {
        listed = true;
      } else if (line.empty()) {
        listed = false;
      } else if (listed && line.size() > 2 && line[2] != ' ') {
        verbs.push_back(line.substr(2, line.find(' ', 2) - 2));
      }
    }
    return verbs;
  }

  VerbOptions OptionsOf(const std::string& verb) const {
    std::istringstream help(Run({verb, "--help"}).out);
    VerbOptions options;
    for (std::string line; std::getline(help, line);) {
      std::istringstream words(line);
      std::string name, type;
      words >> name >> type;
      if (name.find(',') != std::string::npos) name = name.substr(name.find(',') + 1);
      if (type == "FILE") options.inputs.push_back({name});
      if (type == "NEW_FILE" || type == "FOLDER") options.outputs.push_back({name});
    }
    return options;
  }

  // The command with every input named, and one output.
  std::vector<std::string> Command(const std::string& verb, const VerbOptions& options,
                                   const std::map<std::string, std::string>& paths) const {
    std::vector<std::string> command = {verb}, positional;
    for (const auto* list : {&options.inputs, &options.outputs}) {
      for (const FileOption& option : *list) {
        const auto path = paths.find(option.name);
        if (path == paths.end()) continue;
        if (!option.positional()) {
          command.insert(command.end(), {option.name, path->second});
        } else {
          positional.push_back(path->second);
        }
      }
    }
    command.insert(command.end(), positional.begin(), positional.end());
    return command;
  }

  std::map<std::string, std::string> Hashes() const {
    std::map<std::string, std::string> hashes;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_)) {
      if (entry.is_regular_file()) {
        hashes[entry.path().string()] = data::FileSha256(entry.path().string());
      }
    }
    return hashes;
  }

  void ExpectKept(const std::vector<std::string>& command, const std::string& word) const {
    const auto before = Hashes();
    const Outcome outcome = Run(command);
    const std::string line = ::testing::PrintToString(command);
    EXPECT_EQ(outcome.code, 2) << line << outcome.err;
    EXPECT_EQ(outcome.out, "") << line;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << line << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(word)) << line;
    EXPECT_EQ(Hashes(), before) << line;
  }

  // expose takes a run or a survey, not both: everything else can be named at once.
  static std::vector<VerbOptions> Variants(const VerbOptions& all) {
    VerbOptions with = all, without = all;
    const auto is = [](const char* name) {
      return [name](const FileOption& option) { return option.name == name; };
    };
    if (std::none_of(all.inputs.begin(), all.inputs.end(), is("RUN"))) return {all};
    std::erase_if(with.inputs, is("--survey"));
    std::erase_if(without.inputs, is("RUN"));
    return {with, without};
  }

  // What the first file of a folder of figures is called.
  static constexpr const char* kFigure = "figure-15.svg";
};

TEST_F(VerbFilesTest, HelpListsTheVerbsAndTheirFiles) {
  EXPECT_GE(Verbs().size(), 12u);
  EXPECT_EQ(OptionsOf("reconstruct").inputs.size(), 5u);
  EXPECT_EQ(OptionsOf("reconstruct").outputs.size(), 4U);
  EXPECT_EQ(OptionsOf("convert").outputs.size(), 1u);
}

TEST_F(VerbFilesTest, NoOutputReplacesAnInput) {
  int tried = 0;
  for (const std::string& verb : Verbs()) {
    for (const VerbOptions& options : Variants(OptionsOf(verb))) {
      std::map<std::string, std::string> paths;
      for (const FileOption& input : options.inputs) {
        paths[input.name] = Put("in_" + input.name, "of " + input.name);
      }
      for (const FileOption& output : options.outputs) {
        for (const FileOption& input : options.inputs) {
          auto all = paths;
          all[output.name] = paths[input.name];
          if (output.name == "--figures") {
            const auto folder = folder_ / ("as" + input.name);
            std::filesystem::create_directories(folder);
            std::filesystem::create_symlink(folder_ / paths[input.name], folder / kFigure);
            all[output.name] = folder.string();
          }
          ExpectKept(Command(verb, options, all), "would replace it, and it is the input");
          ++tried;
        }
      }
    }
  }
  EXPECT_GT(tried, 30);
}

TEST_F(VerbFilesTest, WhateverItIsCalled) {
  std::filesystem::create_directories(folder_ / "sub");
  Put("scene.toml", "");
  std::filesystem::create_symlink("scene.toml", folder_ / "soft");
  std::filesystem::create_symlink("soft", folder_ / "softer");
  std::filesystem::create_hard_link(folder_ / "scene.toml", folder_ / "hard");
  std::filesystem::create_directory_symlink(folder_, folder_ / "here");
  for (const char* name :
       {"soft", "softer", "hard", "sub/../scene.toml", "here/scene.toml", "./sub/..//here/hard"}) {
    ExpectKept({"simulate", "scene.toml", "-o", name}, "would replace it");
    ExpectKept({"simulate", name, "-o", "scene.toml"}, "would replace it");
  }
}

TEST_F(VerbFilesTest, NorAFileThatAnInputNames) {
  Put("common.toml", "deep = 'deep.bin'\n");
  Put("deep.bin", "counts");
  Put("lines_1.bin", "counts");
  Put("points.csv", "counts");
  const std::string text =
      "include = ['common.toml']\n[a]\nfiles = ['lines_*.bin']\n[[b]]\nc = { points = "
      "'points.csv' }\n";
  const char* named[] = {"common.toml", "deep.bin", "lines_1.bin", "points.csv"};
  std::size_t turn = 0;
  for (const std::string& verb : Verbs()) {
    for (const VerbOptions& options : Variants(OptionsOf(verb))) {
      std::map<std::string, std::string> paths;
      for (const FileOption& input : options.inputs) {
        paths[input.name] = Put("in_" + input.name + ".toml", text);
      }
      for (const FileOption& output : options.outputs) {
        if (output.name == "--figures" || options.inputs.empty()) continue;
        auto all = paths;
        all[output.name] = named[turn++ % std::size(named)];
        ExpectKept(Command(verb, options, all), "would replace it, and it is an input, named in");
      }
    }
  }
}

TEST_F(VerbFilesTest, NorOneThatTheCommandLineSets) {
  Put("other.toml", "");
  Put("scene.toml", "");
  ExpectKept({"simulate", "scene.toml", "--set", "include=['other.toml']", "-o", "other.toml"},
             "named by --set");
  Put("tracks.csv", "");
  ExpectKept({"fit", "scene.toml", "--set", "trial.tracks=tracks.csv", "-o", "tracks.csv"},
             "named by --set");
}

// By another ending, with blanks and signs in its name, by the word of a command.
TEST_F(VerbFilesTest, NorOneThatIsNamedInAnOddWay) {
  Put("tracks.csv", "");
  Put("a = b, [c].csv", "");
  Put("model.py", "");
  for (const char* study : {"study.cfg", "study", "STUDY.TOML"}) {
    Put(study,
        "[trial]\ntracks = 'tracks.csv'\n[model]\ncommand = ['python3', '{study}/model.py', "
        "'--data={study}//a = b, [c].csv']\n");
    for (const char* input : {"tracks.csv", "model.py", "a = b, [c].csv"}) {
      ExpectKept({"fit", study, "-o", "new.h5", "--report", input}, "an input, named in");
    }
  }
  ExpectKept({"fit", "study", "--set", "trial.tracks='a = b, [c].csv'", "-o", "a = b, [c].csv"},
             "an input, named");
  ExpectKept(
      {"simulate", "new.toml", "--set", "include=['a = b, [c].csv']", "-o", "a = b, [c].csv"},
      "named by --set");
}

// Names that come out of a pipe are known once it is read: nothing is replaced then.
TEST_F(VerbFilesTest, NorOneThatAPipeNames) {
  const std::string table =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz [m^2]\n"
      "0,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n0.1,m,0,0,0,1e-8,0,0,1e-8,0,1e-8\n";
  Put("tracks.csv", table);
  ASSERT_EQ(Run({"convert", "tracks.csv", "tracks.h5"}).code, 0);
  const std::string tracks = Get("tracks.h5");
  ASSERT_EQ(mkfifo((folder_ / "study.toml").c_str(), 0600), 0);
  std::thread writer([&] {
    std::ofstream(folder_ / "study.toml")
        << "[study]\nname = 'x'\n[trial]\ntracks = 'tracks.h5'\n[model]\ncommand = ['true']\n"
           "[parameter.a]\nstart = 1.0\nbounds = [0.5, 2.0]\n";
  });
  const Outcome outcome = Run({"fit", "study.toml", "--allow-programs", "-o", "tracks.h5"});
  writer.join();
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("is an input of this result"), std::string::npos) << outcome.err;
  EXPECT_EQ(Get("tracks.h5"), tracks);
}

// What a killed program left behind is somebody's last copy when it is read.
TEST_F(VerbFilesTest, NorATemporaryThatIsRead) {
  const std::string name = ".rig.h5.abc123.tmp";
  std::filesystem::copy_file(Shipped("survey.h5"), folder_ / name);
  std::filesystem::last_write_time(
      folder_ / name, std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  const std::string hash = data::FileSha256((folder_ / name).string());
  const Outcome outcome = Run({"calibrate", name, "--folds", "2", "-o", "rig.h5", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(data::FileSha256((folder_ / name).string()), hash);
}

TEST_F(VerbFilesTest, NorStandardOutput) {
  Put("scene.toml", "");
  for (const char* name : {"/dev/fd/1", "/proc/self/fd/1"}) {
    ExpectKept({"convert", Shipped("survey.h5"), name, "--quiet"}, name);
    ExpectKept({"plan", Shipped("rig.h5"), "--columns", "2", "--report", name}, "device or pipe");
  }
  std::filesystem::create_directories(folder_ / "sub");
  ExpectKept({"plan", Shipped("rig.h5"), "--columns", "2", "--report", "sub"}, "is a folder");
}

TEST_F(VerbFilesTest, NorWhatIsWrittenOnTheWay) {
  Put("run.h5.partial", "a run that was stopped");
  ExpectKept({"convert", "run.h5.partial", "run.h5"}, "would replace it");
  Put("scene.toml", "");
  Put("lab.toml", "");
  ExpectKept({"expose", "run.h5.partial", "--lab", "lab.toml", "-o", "run.h5"}, "would replace it");
}

TEST_F(VerbFilesTest, NoTwoOutputsAreOneFile) {
  std::filesystem::create_directories(folder_ / "sub");
  for (const std::string& verb : Verbs()) {
    for (const VerbOptions& options : Variants(OptionsOf(verb))) {
      std::map<std::string, std::string> paths;
      for (const FileOption& input : options.inputs) {
        paths[input.name] = Put("in_" + input.name, "of " + input.name);
      }
      for (std::size_t i = 0; i < options.outputs.size(); ++i) {
        for (std::size_t j = i + 1; j < options.outputs.size(); ++j) {
          if (options.outputs[j].name == "--figures") continue;
          auto all = paths;
          all[options.outputs[i].name] = "new.out";
          all[options.outputs[j].name] = "sub/../new.out";
          ExpectKept(Command(verb, options, all), "would both write it");
        }
      }
    }
  }
}

TEST_F(VerbFilesTest, ADefaultNameThatIsTakenNeedsForce) {
  const std::vector<std::string> simulate = {
      "simulate", Shipped("scene_suspension.toml"), "--duration", "0.02",
      "--set",    "beam.beam1.segments=2",          "--set",      "beam.beam2.segments=2",
      "--set",    "beam.beam3.segments=2",          "--set",      "beam.beam4.segments=2"};
  const std::string name = "scene_suspension.h5";
  Put(name, "of a camera, by the default's name");
  ExpectKept(simulate, "did not make it");
  auto forced = simulate;
  forced.push_back("--force");
  ASSERT_EQ(Run(forced).code, 0);
  const std::string made = Get(name);
  EXPECT_GT(made.size(), 1000u);
  EXPECT_EQ(Run(simulate).code, 0) << "its own earlier result may be replaced";

  // A run is no trial: another verb made what lies there.
  std::filesystem::rename(folder_ / name, folder_ / "trial.h5");
  Put("run.h5", made);
  const std::vector<std::string> expose = {"expose", "run.h5", "--lab", Shipped("lab.toml")};
  ExpectKept(expose, "did not make it");
}

// What is written into a folder was not named on the command line either.
TEST_F(VerbFilesTest, NamesInAFolderThatAreTakenNeedForce) {
  const std::vector<std::string> completion = {"completion", "--into", "share"};
  auto forced = completion;
  forced.push_back("--force");
  ASSERT_EQ(Run(completion).code, 0);
  EXPECT_EQ(Run(completion).code, 0) << "its own earlier files may be replaced";
  const auto made = Hashes();
  EXPECT_EQ(made.size(), Verbs().size() + 4);  // a page for each and one for all; three shells
  for (const auto& [path, hash] : made) {
    const std::string name = std::filesystem::relative(path, folder_).string();
    Put(name, "of somebody else");
    ExpectKept(completion, "did not make it");
    EXPECT_EQ(Run(forced).code, 0) << name;
    EXPECT_EQ(Hashes(), made) << name;
  }

  std::filesystem::create_directories(folder_ / "figures");
  Put("a.csv", "");
  Put("b.csv", "");
  for (const char* name : {kFigure, "figure-16a.svg", "figure-16b.svg", "figure-17.svg"}) {
    Put(std::string("figures/") + name, "<svg></svg>");
    ExpectKept({"correlate", "a.csv", "b.csv", "--figures", "figures"}, "did not make it");
    std::filesystem::remove(folder_ / "figures" / name);
  }
  // A pipe is no file of anyone's, and nothing waits on it.
  ASSERT_EQ(mkfifo((folder_ / "figures" / kFigure).c_str(), 0600), 0);
  ExpectKept({"correlate", "a.csv", "b.csv", "--figures", "figures"}, "did not make it");
}

TEST_F(VerbFilesTest, ForceDoesNotReachInputs) {
  Put("tracks.h5", "a trial by that name");
  Put("rig.h5", "");
  ExpectKept({"reconstruct", "tracks.h5", "--rig", "rig.h5"}, "it is the input TRIAL");
  ExpectKept({"reconstruct", "tracks.h5", "--rig", "rig.h5", "--force"}, "it is the input TRIAL");
}

}  // namespace
}  // namespace unfurl::cli::verb_files_test
