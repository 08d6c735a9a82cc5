#include "campaign/statistics/counter_random.h"

#include <cmath>
#include <numbers>

namespace unfurl::campaign {

namespace {

constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ULL;  // 2^64 over the golden ratio [SplitMix64]

}  // namespace

std::array<std::uint32_t, 4> Philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key) {
  // Multipliers and Weyl increments of Philox4x32 [Salmon et al. 2011, table 2]; ten rounds.
  constexpr std::uint64_t kM0 = 0xD2511F53u, kM1 = 0xCD9E8D57u;
  constexpr std::uint32_t kW0 = 0x9E3779B9u, kW1 = 0xBB67AE85u;  // increments of the key
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = kM0 * counter[0], p1 = kM1 * counter[2];
    counter = {
        static_cast<std::uint32_t>(p1 >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(p1),
        static_cast<std::uint32_t>(p0 >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(p0)};
    key[0] += kW0;
    key[1] += kW1;
  }
  return counter;
}

std::uint64_t SplitMix(std::uint64_t key, std::uint64_t index) {
  std::uint64_t z = key + (index + 1) * kGolden;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double OpenUniform(std::uint64_t bits52) { return (static_cast<double>(bits52) + 0.5) * 0x1p-52; }

std::array<std::uint64_t, 2> CounterRandom::Pair(std::uint64_t index,
                                                 std::uint32_t dimension) const {
  const auto r =
      Philox({static_cast<std::uint32_t>(index), static_cast<std::uint32_t>(index >> 32), dimension,
              stream_},
             {static_cast<std::uint32_t>(seed_), static_cast<std::uint32_t>(seed_ >> 32)});
  return {(static_cast<std::uint64_t>(r[0]) << 32) | r[1],
          (static_cast<std::uint64_t>(r[2]) << 32) | r[3]};
}

std::uint64_t CounterRandom::Bits(std::uint64_t index, std::uint32_t dimension) const {
  return Pair(index, dimension)[0];
}

void CounterRandom::Normals(std::uint64_t index, std::span<double> z) const {
  for (std::size_t k = 0; k < z.size(); k += 2) {
    const auto [a, b] = Pair(index, static_cast<std::uint32_t>(k / 2));
    const double radius = std::sqrt(-2.0 * std::log(OpenUniform(a >> 12)));
    const double angle = 2.0 * std::numbers::pi * OpenUniform(b >> 12);
    z[k] = radius * std::cos(angle);
    if (k + 1 < z.size()) z[k + 1] = radius * std::sin(angle);
  }
}

KeyedPermutation::KeyedPermutation(std::uint64_t size, std::uint64_t key) : size_(size) {
  for (int round = 0; round < kRounds; ++round) {
    keys_[static_cast<std::size_t>(round)] = SplitMix(key, static_cast<std::uint64_t>(round));
  }
  while (half_bits_ < 32 && (std::uint64_t{1} << (2 * half_bits_)) < size) ++half_bits_;
}

std::uint64_t KeyedPermutation::Network(std::uint64_t i) const {
  const std::uint64_t mask = (std::uint64_t{1} << half_bits_) - 1;
  std::uint64_t left = i >> half_bits_, right = i & mask;
  for (const std::uint64_t key : keys_) {
    const std::uint64_t f = SplitMix(key, right) >> (64 - half_bits_);
    const std::uint64_t next = left ^ f;
    left = right;
    right = next;
  }
  return (left << half_bits_) | right;
}

std::uint64_t KeyedPermutation::operator()(std::uint64_t i) const {
  do {
    i = Network(i);
  } while (i >= size_);
  return i;
}

}  // namespace unfurl::campaign
