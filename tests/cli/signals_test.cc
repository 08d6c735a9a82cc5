// Signals end every verb, also one that hangs in a read; inputs from pipes; names and machines that
// refuse.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "data/provenance.h"
#include "tests/cli/program.h"

namespace unfurl::cli::signals_test {
namespace {

using ::testing::HasSubstr;

// Once the program handles signals it gets `signal`, `wait` later.
Outcome Stop(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
             int signal, std::chrono::milliseconds wait) {
  const std::string words = folder.string() + ".words";
  const pid_t child = fork();
  if (child == 0) {
    const int file = open(words.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    if (chdir(folder.c_str()) != 0) _exit(120);
    std::vector<char*> argv = {const_cast<char*>(UNFURL_PROGRAM)};
    for (const std::string& word : arguments) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    execv(UNFURL_PROGRAM, argv.data());
    _exit(121);
  }
  const std::string about = "/proc/" + std::to_string(child) + "/status";
  for (bool handles = false; !handles;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    std::ifstream stream(about);
    if (!stream) break;
    for (std::string line; std::getline(stream, line);) {
      if (!line.starts_with("SigCgt:")) continue;
      handles = (std::stoull(line.substr(8), nullptr, 16) >> (SIGTERM - 1) & 1) != 0;
    }
  }
  std::this_thread::sleep_for(wait);
  kill(child, signal);
  int status = 0;
  waitpid(child, &status, 0);
  Outcome outcome;
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
  std::ifstream stream(words);
  outcome.err.assign(std::istreambuf_iterator<char>(stream), {});
  std::filesystem::remove(words);
  return outcome;
}

const std::vector<std::string> kShortRun = {"--duration", "0.02",
                                            "--set",      "beam.beam1.segments=2",
                                            "--set",      "beam.beam2.segments=2",
                                            "--set",      "beam.beam3.segments=2",
                                            "--set",      "beam.beam4.segments=2"};

class Signals : public ProgramTest {
 protected:
  std::string Pipe(const std::string& name) const {
    mkfifo((folder_ / name).c_str(), 0600);
    return name;
  }
  static void ExpectOneLine(const Outcome& outcome) {
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  // One after the other, so that `add` follows the words.
  static std::vector<std::string> With(std::vector<std::string> words,
                                       const std::vector<std::string>& add) {
    words.insert(words.end(), add.begin(), add.end());
    return words;
  }
};

// Nobody ever writes to the pipe: each verb waits for its input.
TEST_F(Signals, EndVerbsThatHangInARead) {
  Pipe("in.toml");
  Pipe("in.csv");
  Pipe("in.h5");
  Put("old.h5", "what was there");
  const auto before = Files();
  const std::vector<std::vector<std::string>> verbs = {
      {"simulate", "in.toml", "-o", "old.h5"},
      {"modes", "in.toml", "-o", "old.h5"},
      {"expose", "--survey", "in.csv", "--lab", Shipped("lab.toml"), "-o", "old.h5"},
      {"plan", "in.toml", "--report", "old.h5"},
      {"calibrate", "in.csv", "-o", "old.h5"},
      {"check", Shipped("rig.h5"), "in.csv", "--report", "old.h5"},
      {"reconstruct", "in.h5", "--rig", Shipped("rig.h5"), "--start", "in.csv", "-o", "old.h5"},
      {"reconstruct", "in.csv", "--rig", Shipped("rig.h5"), "-o", "old.h5"},
      {"correlate", "in.csv", "in.csv", "-o", "old.h5"},
      {"fit", "in.toml", "-o", "old.h5"},
      {"cost", "in.toml", "--report", "old.h5"},
      {"info", "in.csv"},
      {"convert", "in.csv", "old.h5"}};
  const std::vector<std::pair<int, int>> signals = {{SIGTERM, 143}, {SIGINT, 130}, {SIGHUP, 143}};
  std::size_t turn = 0;
  for (const auto& verb : verbs) {
    const auto [signal, code] = signals[turn++ % signals.size()];
    const Outcome outcome = Stop(verb, folder_, signal, std::chrono::milliseconds(20));
    ExpectOneLine(outcome);
    if (verb[1] == "in.h5") {
      EXPECT_EQ(outcome.code, 2) << "HDF5 cannot come from a pipe";
      continue;
    }
    EXPECT_EQ(outcome.code, code) << verb[0] << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("interrupted")) << verb[0];
  }
  EXPECT_EQ(Files(), before);
  EXPECT_EQ(Get("old.h5"), "what was there");
}

// Work that asks no one whether it should stop is stopped, and what was there stays.
TEST_F(Signals, EndACalibrationAndLeaveTheOldRig) {
  Put("rig.h5", "the old one");
  for (const int wait : {0, 30, 100}) {
    const Outcome outcome = Stop({"calibrate", Shipped("survey.h5"), "-o", "rig.h5"}, folder_,
                                 SIGTERM, std::chrono::milliseconds(wait));
    EXPECT_EQ(outcome.code, 143) << outcome.err;
    ExpectOneLine(outcome);
    EXPECT_EQ(Get("rig.h5"), "the old one");
    EXPECT_EQ(Files(), std::vector<std::string>{"rig.h5"});
  }
}

TEST_F(Signals, ASceneMayComeFromAPipe) {
  std::ifstream stream(Shipped("scene_suspension.toml"));
  const std::string scene((std::istreambuf_iterator<char>(stream)), {});
  Pipe("scene.toml");
  std::thread writer([&] { std::ofstream(folder_ / "scene.toml") << scene; });
  const Outcome run = Run(With({"simulate", "scene.toml", "-o", "run.h5"}, kShortRun));
  writer.join();
  ASSERT_EQ(run.code, 0) << run.err;
  const auto info = nlohmann::json::parse(Run({"info", "run.h5", "--json"}).out);
  Put("copy.toml", scene);
  EXPECT_EQ(info.at("inputs").at(0).at("sha256"),
            data::FileSha256((folder_ / "copy.toml").string()));
}

// A name in Latin 1 is no UTF-8; it works, and is shown escaped.
TEST_F(Signals, NamesThatAreNoUtf8) {
  const std::string run = "Entfaltung_\xfc.h5", scene = "caf\xe9.toml";
  std::filesystem::copy_file(Shipped("scene_suspension.toml"), folder_ / scene);
  const Outcome made = Run(With({"simulate", scene, "-o", run, "--json"}, kShortRun));
  EXPECT_EQ(made.code, 0) << made.err;
  EXPECT_FALSE(nlohmann::json::parse(made.out).empty());
  const Outcome info = Run({"info", run});
  EXPECT_EQ(info.code, 0) << info.err;
  EXPECT_THAT(info.out, HasSubstr("Entfaltung_\\xfc.h5"));
  EXPECT_EQ(Run({"info", run, "--json"}).code, 0);
  const Outcome none = Run({"info", "none_\xfc\x1b[2J\n.h5"});
  EXPECT_EQ(none.code, 2);
  ExpectOneLine(none);
  EXPECT_THAT(none.err, HasSubstr("none_\\xfc\\x1b[2J"));
}

// Exit code 1 has its line, too.
TEST_F(Signals, WhatIsNotUsableSaysSoOnStandardError) {
  Put("scene.toml",
      "[scene]\nname = 'x'\nduration = 1.0\n[body.a]\nmass = 1.0\ninertia = 0.1\n"
      "[joint.pin]\ninner = 'ground'\nouter = 'a'\nouter_point = [-1.0, 0.0]\n"
      "[force.push]\non = 'a'\nvalue = ['1/(0.5 - t)', '0']\n[mark.m]\non = 'a'\n");
  for (const char* how : {"--json", "--quiet"}) {
    const Outcome outcome = Run({"simulate", "scene.toml", "-o", "run.h5", how});
    if (outcome.code == 0) continue;
    EXPECT_NE(outcome.code, 3) << outcome.err;
    ExpectOneLine(outcome);
  }
}

TEST_F(Signals, ProgramsOfStrangersAreNotRun) {
  Put("study.toml",
      "[study]\nname = 'x'\n[trial]\ntracks = 'tracks.csv'\n[model]\ncommand = ['touch', "
      "'{study}/was_here']\n[parameter.a]\nstart = 1.0\nbounds = [0.5, 2.0]\n");
  Put("tracks.csv", "t [s],mark,x [m],y [m],z [m]\n");
  const auto before = Files();
  ExpectRefused(Run({"fit", "study.toml"}), {"study.toml:6:model.command", "--allow-programs"},
                before);
  setenv("UNFURL_ALLOW_PROGRAMS", "1", 1);
  const Outcome allowed = Run({"fit", "study.toml"});
  unsetenv("UNFURL_ALLOW_PROGRAMS");
  EXPECT_EQ(allowed.err.find("--allow-programs"), std::string::npos) << allowed.err;
}

// A machine that gives no memory and no threads is told as such, whatever the verb.
TEST_F(Signals, MachinesThatRefuse) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "its shadow memory is larger than any limit";
#endif
  constexpr rlim_t kSmall = rlim_t{700} << 20;  // [byte]; the program and its libraries take 250 MB
  rlimit old = {};
  getrlimit(RLIMIT_AS, &old);
  const rlimit small = {kSmall, old.rlim_max};
  setrlimit(RLIMIT_AS, &small);
  const Outcome outcome = Run({"simulate", Shipped("scene_suspension.toml"), "--set",
                               "beam.beam1.segments=1000000", "-o", "run.h5"});
  setrlimit(RLIMIT_AS, &old);
  ExpectRefused(outcome, {"unfurl: simulate: the machine has not enough memory for this"}, {}, 4);
}

}  // namespace
}  // namespace unfurl::cli::signals_test
