#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/cli/program.h"

namespace unfurl::cli {

// A job of each verb that writes something, small enough to be run hundreds of times.
struct SmallJob {
  std::vector<std::string> command;
  std::string output;
  bool tells_times = false;  // of its own work: no two outputs are alike
  std::string name() const { return command[0] + " " + output; }
};

class SmallJobsTest : public ProgramTest {
 protected:
  // Makes the jobs' inputs. UNFURL_JOB=campaign in the environment keeps the jobs of that verb only.
  void SetUp() override;
  // Runs it; the exit code is 0, or 1 where the result is written and not usable.
  Outcome Good(const std::vector<std::string>& command) const;
  // The job's output, made undisturbed, and removed again.
  std::string Undisturbed(const SmallJob& job) const;

  std::vector<SmallJob> jobs_;
};

// What a file holds but for the command that made it: of HDF5 all datasets and attributes, else its
// bytes.
std::string ContentsOf(const std::string& path);

}  // namespace unfurl::cli
