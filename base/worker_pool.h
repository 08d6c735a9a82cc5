#pragma once

#include <cstddef>
#include <functional>

namespace unfurl {

// Number of workers to use when the caller asks for `requested`; 0 means all cores.
std::size_t WorkerCount(std::size_t requested);

// Calls task(i) for i in [0, count) on `workers` threads (0: all cores). Tasks must be independent;
// what each computes must depend on its index alone, so that results do not depend on the number of
// workers. The first exception (by index) is rethrown when all threads have stopped.
// After Ctrl-C no further task begins, and Interrupted is thrown.
void ParallelFor(std::size_t count, std::size_t workers,
                 const std::function<void(std::size_t)>& task);

}  // namespace unfurl
