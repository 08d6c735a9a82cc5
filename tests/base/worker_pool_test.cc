#include "base/worker_pool.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

namespace unfurl::worker_pool_test {
namespace {

TEST(ParallelFor, DoesEachTaskOnceWhateverTheNumberOfWorkers) {
  for (std::size_t workers : {1, 2, 7}) {
    std::vector<int> done(1000, 0);
    ParallelFor(done.size(), workers, [&](std::size_t i) { done[i] += static_cast<int>(i); });
    for (std::size_t i = 0; i < done.size(); ++i) ASSERT_EQ(done[i], static_cast<int>(i));
  }
  ParallelFor(0, 4, [](std::size_t) { FAIL(); });
}

TEST(ParallelFor, HandsOnTheFirstException) {
  for (std::size_t workers : {1, 3}) {
    EXPECT_THROW(ParallelFor(50, workers,
                             [](std::size_t i) {
                               if (i == 20) throw std::runtime_error("twenty");
                             }),
                 std::runtime_error);
  }
}

}  // namespace
}  // namespace unfurl::worker_pool_test
