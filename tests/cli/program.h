#pragma once

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace unfurl::cli {

struct Outcome {
  int code = -1;
  std::string out;
  std::string err;
  long peak_kb = 0;  // of memory
};

// Runs the real program in `folder`. `file_size_limit` > 0 makes every write past so many bytes of
// one file fail, as a full disk does. `kill_after_ms` > 0 sends `kill_signal` then. `in_child` runs
// in the new process before the program does.
Outcome RunProgram(const std::vector<std::string>& arguments, const std::filesystem::path& folder,
                   long file_size_limit = 0, int kill_after_ms = 0, int kill_signal = SIGINT,
                   const std::function<void()>& in_child = {});

// A folder of its own per test, removed afterwards.
class ProgramTest : public ::testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  Outcome Run(const std::vector<std::string>& arguments) const {
    return RunProgram(arguments, folder_);
  }
  std::string Put(const std::string& name, const std::string& text) const;
  std::string Get(const std::string& name) const;
  // Names of all files there, hidden ones included.
  std::vector<std::string> Files() const;
  // A file of the shipped set.
  static std::string Shipped(const std::string& name);

  // Exit code 2 (or `code`), silence on stdout, and one line on stderr that holds each of `words`;
  // nothing but `files_before` is left in the folder.
  void ExpectRefused(const Outcome& outcome, const std::vector<std::string>& words,
                     const std::vector<std::string>& files_before, int code = 2) const;

  std::filesystem::path folder_;
};

}  // namespace unfurl::cli
