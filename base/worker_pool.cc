#include "base/worker_pool.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "base/progress.h"

namespace unfurl {

std::size_t WorkerCount(std::size_t requested) {
  if (requested > 0) return requested;
  return std::max<std::size_t>(1, std::thread::hardware_concurrency());
}

void ParallelFor(std::size_t count, std::size_t workers,
                 const std::function<void(std::size_t)>& task) {
  workers = std::min(WorkerCount(workers), count);
  if (workers <= 1) {
    for (std::size_t i = 0; i < count; ++i) {
      ThrowIfInterrupted();
      task(i);
    }
    return;
  }
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr error;
  std::size_t error_index = count;
  auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        ThrowIfInterrupted();
        task(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (i < error_index) {
          error_index = i;
          error = std::current_exception();
        }
        next = count;
      }
    }
  };
  {
    std::vector<std::jthread> threads;
    for (std::size_t w = 1; w < workers; ++w) threads.emplace_back(work);
    work();
  }
  if (error) std::rethrow_exception(error);
}

}  // namespace unfurl
