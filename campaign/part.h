#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "campaign/inputs.h"
#include "campaign/job.h"
#include "data/campaign.h"

namespace unfurl::campaign {

/// Runs that follow one another.
struct RunRange {
  std::uint64_t first = 0, count = 0;
  /// One past the last.
  std::uint64_t end() const { return first + count; }
};

/// The i-th of n nearly equal parts of all runs, i from 1.
RunRange ShardRange(std::uint64_t runs, std::uint64_t i, std::uint64_t n);

/// "0:100", from the first to before the second; false for what is none.
bool ParseRange(const std::string& text, RunRange* range);
/// That text.
std::string RangeText(const RunRange& range);

/// What some runs gave.
struct Part {
  RunRange range;
  std::vector<double> responses;      ///< by run, k each [units of the responses]
  std::vector<std::uint64_t> failed;  ///< runs that failed, rising
  std::vector<std::string> messages;  ///< why, likewise
  double cpu_seconds = 0.0;           ///< of computing it [s]; not the same from time to time
  double wall_seconds = 0.0;          ///< likewise [s]
};

/// Runs them one after another; `progress` gets the number that are done and may throw.
Part RunPart(const Inputs& inputs, Job* job, const RunRange& range,
             const std::function<void(std::uint64_t)>& progress = {});

/// A part of which no run ended: each failed for the same reason.
Part FailedPart(const RunRange& range, std::size_t responses, const std::string& message);

/// As a file, with checksums; whole or not at all. `identity`: of the campaign.
void WritePart(const std::string& path, const Part& part, const std::string& identity,
               std::size_t responses);
/// Throws Error for a file that is damaged, or of another campaign.
Part ReadPart(const std::string& path, const std::string& identity, std::size_t responses);

}  // namespace unfurl::campaign
