#pragma once

#include <ctime>

namespace unfurl {

/// CPU time that this process (or, by its clock, this thread) has taken so far, all of its threads
/// together [s]: what a computation costs on a machine that is busy with other work, too.
inline double CpuSeconds(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Since some moment of this machine, never set back [s]: for differences.
inline double WallSeconds() { return CpuSeconds(CLOCK_MONOTONIC); }

}  // namespace unfurl
