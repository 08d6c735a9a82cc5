#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/cli/program.h"

namespace unfurl::cli {

// The main job through the real program, with a hidden truth of its own: survey and trial are made
// by rays through glass from `seed`, and everything after that sees only what a user would.
struct JobSettings {
  std::uint64_t seed = 1;
  int segments = 16;       // of every beam in the truth; the shipped study fits with 8
  double duration = 5.0;   // of the deployment [s]
  double clearance = 0.0;  // true, both angles of all latches [rad]
  double damping = 0.0;    // true, of all beams [s]
  std::string study;       // fitted; the shipped one where empty
};

struct JobResult {
  double marks_rms = 0.0;  // reconstructed against true marks, 3-D, all samples [m]
  double largest = 0.0;    // [m]
  nlohmann::json fit;      // what `unfurl fit --json` prints
  // value, sigma of the named parameter.
  std::pair<double, double> Estimate(const std::string& parameter) const;
};

class MainJobTest : public ProgramTest {
 protected:
  // Runs expose, calibrate, reconstruct and fit in the test's folder; test failures tell which step
  // failed and what it said.
  void RunJob(const JobSettings& settings, JobResult* result) const;
  // The shipped study on four segments a beam, in the test's folder; `more` is added at its end.
  std::string StudyOnFourSegments(const std::string& more = "") const;
  // Runs a step and expects exit code 0.
  Outcome Good(const std::vector<std::string>& arguments) const;
};

// RMS and largest distance of two tracks files' samples, matched by mark and order of time.
void CompareTracks(const std::string& path, const std::string& truth, double* rms, double* largest);

}  // namespace unfurl::cli
