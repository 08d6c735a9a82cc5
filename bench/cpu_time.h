#pragma once

#include <algorithm>
#include <cstddef>
#include <ctime>
#include <functional>
#include <vector>

namespace unfurl::bench {

// Seconds that a clock of the cores has run, of this process or of this thread: other work on the
// machine does not count.
inline double CpuSeconds(clockid_t clock = CLOCK_PROCESS_CPUTIME_ID) {
  timespec now;
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
inline double ThreadSeconds() { return CpuSeconds(CLOCK_THREAD_CPUTIME_ID); }

// Seconds per call: the median of five rounds of `count` calls.
inline double SecondsEach(std::size_t count, const std::function<void(std::size_t)>& call) {
  std::vector<double> rounds;
  for (int round = 0; round < 5; ++round) {
    const double start = CpuSeconds();
    for (std::size_t i = 0; i < count; ++i) call(i);
    rounds.push_back((CpuSeconds() - start) / static_cast<double>(count));
  }
  std::sort(rounds.begin(), rounds.end());
  return rounds[2];
}

}  // namespace unfurl::bench
