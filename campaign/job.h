#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/campaign.h"

namespace unfurl::campaign {

/// What became of one run.
struct RunOutcome {
  bool good = false;
  std::string message;  ///< why not, one line; empty of a good one
};

/// What a campaign runs again and again. Not for several threads at once.
class Job {
 public:
  virtual ~Job() = default;
  /// With the variables' values, in the plan's order, into the responses, likewise. A response that
  /// a good run does not have (the time of an event that did not happen) is NaN. Values with which
  /// it cannot run are a failed run, not an Error.
  virtual RunOutcome Run(std::uint64_t index, std::span<const double> values,
                         std::span<double> responses) = 0;
  /// Every file that the runs depend on.
  virtual std::vector<std::string> inputs() const = 0;
};

/// What a job may do.
struct JobOptions {
  std::string program;          ///< this program's file, for steps
  bool allow_programs = false;  ///< other programs may be run
};

/// Throws Error (file:line:key) for a plan whose names are not those of its job; `typical` are
/// values of the variables at which that is looked at.
std::unique_ptr<Job> MakeJob(const data::Campaign& plan, std::span<const double> typical,
                             const JobOptions& options);

}  // namespace unfurl::campaign
