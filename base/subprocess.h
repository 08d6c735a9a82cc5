#pragma once

#include <string>
#include <vector>

namespace unfurl {

// What became of a program that was run.
struct ProgramOutcome {
  int code = -1;         // exit code; 128 + signal when one ended it
  bool started = false;  // false: no such program
  bool timed_out = false;
};

// Runs words[0] with the rest as its arguments, found along PATH, in `folder`, with standard output
// and error in the two files and nothing to read, until it ends or `timeout` seconds have passed;
// then it and what it started are killed. Throws Interrupted after Ctrl-C, with the same. Safe from
// several threads.
ProgramOutcome RunProgram(const std::vector<std::string>& words, const std::string& folder,
                          const std::string& out, const std::string& err, double timeout);

}  // namespace unfurl
