#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace unfurl::campaign {

/// The Sobol sequence by the direction numbers of Joe and Kuo (2008), each coordinate scrambled by
/// the nested uniform scrambling of Owen (1995): every block of 2^m points whose first index is a
/// multiple of 2^m stays a net, and each point alone is uniform. The random digits are hashes of
/// the digits above them, so that no tree is stored [Burley 2020, with a stronger hash].
class SobolSequence {
 public:
  static constexpr int kMostDimensions = 3667;  // of the table of direction numbers
  static constexpr int kBits = 52;  // of a coordinate: what a double holds with its cell's middle

  /// Throws Error where `dimensions` is none or beyond the table of direction numbers (3667).
  explicit SobolSequence(int dimensions);

  int dimensions() const { return dimensions_; }
  /// Point `index` < 2^52, unscrambled, as integers of kBits bits.
  std::uint64_t Digits(std::uint64_t index, int dimension) const;
  /// The same scrambled with `key`, strictly inside (0, 1).
  double Scrambled(std::uint64_t index, int dimension, std::uint64_t key) const;

 private:
  int dimensions_;
  std::vector<std::uint64_t> directions_;  // dimensions x kBits
};

}  // namespace unfurl::campaign
