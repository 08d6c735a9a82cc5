#include "tests/cli/program.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <sstream>

#include "tests/source_dir.h"

namespace unfurl::cli {

namespace {

std::string Slurp(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace

Outcome RunProgram(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
                   long file_size_limit, int kill_after_ms, int kill_signal,
                   const std::function<void()>& in_child) {
  // Output goes to files beside the folder, not into it: tests look at what is left there.
  // Several may run at once.
  static std::atomic<int> calls = 0;
  const std::string own = folder.string() + "." + std::to_string(calls++);
  const std::string out_path = own + ".stdout", err_path = own + ".stderr";
  const pid_t child = fork();
  if (child == 0) {
    const int out = open(out_path.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
    const int err = open(err_path.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
    dup2(out, STDOUT_FILENO);
    dup2(err, STDERR_FILENO);
    if (chdir(folder.c_str()) != 0) _exit(120);
    if (file_size_limit > 0) {
      const rlimit limit = {static_cast<rlim_t>(file_size_limit),
                            static_cast<rlim_t>(file_size_limit)};
      setrlimit(RLIMIT_FSIZE, &limit);
    }
    if (in_child) in_child();
    std::vector<char*> argv = {const_cast<char*>(UNFURL_PROGRAM)};
    for (const std::string& argument : arguments)
      argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    execv(UNFURL_PROGRAM, argv.data());
    _exit(121);
  }
  if (kill_after_ms > 0) {
    usleep(static_cast<useconds_t>(kill_after_ms) * 1000);
    kill(child, kill_signal);
  }
  int status = 0;
  rusage usage = {};
  wait4(child, &status, 0, &usage);
  Outcome outcome;
  outcome.peak_kb = usage.ru_maxrss;
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.out = Slurp(out_path);
  outcome.err = Slurp(err_path);
  std::filesystem::remove(out_path);
  std::filesystem::remove(err_path);
  return outcome;
}

void ProgramTest::SetUp() {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  folder_ = std::filesystem::temp_directory_path() /
            (std::string("unfurl_cli_") + info->name() + "_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder_);
}

void ProgramTest::TearDown() { std::filesystem::remove_all(folder_); }

std::string ProgramTest::Put(const std::string& name, const std::string& text) const {
  std::ofstream(folder_ / name, std::ios::binary) << text;
  return name;
}

std::string ProgramTest::Get(const std::string& name) const { return Slurp(folder_ / name); }

std::vector<std::string> ProgramTest::Files() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string ProgramTest::Shipped(const std::string& name) {
  return std::string(UNFURL_SOURCE_DIR) + "/data/sets/deployment/" + name;
}

void ProgramTest::ExpectRefused(const Outcome& outcome, const std::vector<std::string>& words,
                                const std::vector<std::string>& files_before, int code) const {
  EXPECT_EQ(outcome.code, code) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  for (const std::string& word : words) EXPECT_THAT(outcome.err, ::testing::HasSubstr(word));
  EXPECT_EQ(Files(), files_before);
}

}  // namespace unfurl::cli
