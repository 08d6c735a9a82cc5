#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "base/cpu_time.h"

namespace unfurl::bench {

using unfurl::CpuSeconds;
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
