#pragma once

#include <cassert>
#include <cstddef>
#include <vector>

namespace unfurl::calib {

/// The parameter blocks of a problem of Ceres, one behind the other. Of a group Ceres takes the
/// blocks in the order of their addresses: blocks with memory of their own would be eliminated in
/// another order from run to run, and where the data leave a direction open, rounding shows.
class BlockStore {
 public:
  /// For `numbers` in all: blocks never move.
  explicit BlockStore(std::size_t numbers) { numbers_.reserve(numbers); }
  BlockStore(const BlockStore&) = delete;
  BlockStore& operator=(const BlockStore&) = delete;

  /// A block of what `first` holds, `count` numbers.
  double* Add(const double* first, std::size_t count) {
    assert(numbers_.size() + count <= numbers_.capacity());
    numbers_.insert(numbers_.end(), first, first + count);
    return numbers_.data() + (numbers_.size() - count);
  }

 private:
  std::vector<double> numbers_;
};

}  // namespace unfurl::calib
