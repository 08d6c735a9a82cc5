#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace unfurl::campaign {

/// The block function Philox4x32-10 [Salmon et al. 2011]: 128 random bits as a pure function of a
/// counter and a key, so that any point of a design is had without those before it.
std::array<std::uint32_t, 4> Philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key);

/// The output of SplitMix64 [Steele, Lea, Flood 2014] seeded with `key`, at place `index`.
std::uint64_t SplitMix(std::uint64_t key, std::uint64_t index);

/// 52 random bits to a number strictly inside (0, 1): the middles of 2^52 equal cells.
double OpenUniform(std::uint64_t bits52);

/// Random numbers by place: seed, stream (what they are for), index and dimension.
class CounterRandom {
 public:
  CounterRandom(std::uint64_t seed, std::uint32_t stream) : seed_(seed), stream_(stream) {}

  std::uint64_t Bits(std::uint64_t index, std::uint32_t dimension) const;
  /// In (0, 1), neither end included.
  double Uniform(std::uint64_t index, std::uint32_t dimension) const {
    return OpenUniform(Bits(index, dimension) >> 12);
  }

  /// Standard normal numbers, by the transformation of Box and Muller (1958).
  void Normals(std::uint64_t index, std::span<double> z) const;

 private:
  std::array<std::uint64_t, 2> Pair(std::uint64_t index, std::uint32_t dimension) const;

  std::uint64_t seed_;
  std::uint32_t stream_;
};

/// A pseudo-random permutation of 0 .. size - 1 without a table: a Feistel network over the next
/// power of four (256 at least), walked along its cycle until it lands inside [Black and Rogaway
/// 2002].
class KeyedPermutation {
 public:
  /// `size` from 1 to 2^63.
  KeyedPermutation(std::uint64_t size, std::uint64_t key);
  std::uint64_t operator()(std::uint64_t i) const;  // i < size

 private:
  std::uint64_t Network(std::uint64_t i) const;

  std::uint64_t size_;
  // Halves of two bits make but a subgroup of the permutations, of three not all alike: 500000
  // orders of seven show it, and no unevenness with four.
  int half_bits_ = 4;
  // Four rounds make a Feistel network indistinguishable from a random permutation where halves
  // are wide [Luby and Rackoff 1988]; twice that for halves of four bits.
  static constexpr int kRounds = 8;
  std::array<std::uint64_t, kRounds> keys_;
};

}  // namespace unfurl::campaign
