#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "campaign/folder.h"

namespace unfurl::campaign {

/// What engines have in common.
struct EngineOptions {
  std::string program;          ///< this program's file, which computes the parts
  std::size_t workers = 0;      ///< processes of this machine; 0: all cores
  bool allow_programs = false;  ///< steps may run other programs than this one
  double budget = 0.0;          ///< begin no part after so many seconds [s]; 0: no limit
  double mean = 0.0;            ///< of one run, where it is known [s]; 0: it is not
  std::uint64_t most = 0;       ///< nor when so many runs are done; 0: no limit
  /// Of runs done so far, all in all; may throw.
  std::function<void(std::uint64_t)> progress;
};

/// How an engine fared.
struct EngineReport {
  std::uint64_t parts = 0;    ///< computed here
  double run_seconds = 0.0;   ///< wall clock of the processes, summed [s]
  std::uint64_t runs = 0;     ///< in them
  std::uint64_t crashed = 0;  ///< runs that end the program that computes them
};

/// Computes what is missing of the first `runs` runs as parts of the folder, in processes of this
/// machine. A part takes some seconds, so that a kill costs little; a process that ends by a fault
/// is tried again in halves until the run is found that does it, which is a failed run. Throws
/// Error where a process says that the plan or the machine is at fault, Interrupted after Ctrl-C;
/// parts that are whole stay.
EngineReport RunLocally(const CampaignFolder& folder, std::uint64_t runs,
                        const EngineOptions& options);

}  // namespace unfurl::campaign
