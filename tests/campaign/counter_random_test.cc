#include "campaign/statistics/counter_random.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "base/probability.h"
#include "base/statistics.h"

namespace unfurl::campaign::counter_random_test {
namespace {

TEST(Philox, EqualsItsPublishedVectors) {  // kat_vectors of Random123, philox4x32, 10 rounds
  using Block = std::array<std::uint32_t, 4>;
  EXPECT_EQ(Philox({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  const std::uint32_t f = 0xffffffff;
  EXPECT_EQ(Philox({f, f, f, f}, {f, f}), (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(Philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(SplitMix, EqualsItsPublishedSequence) {  // outputs of splitmix64.c for the seed 1234567
  EXPECT_EQ(SplitMix(1234567, 0), 6457827717110365317ULL);
  EXPECT_EQ(SplitMix(1234567, 1), 3203168211198807973ULL);
  EXPECT_EQ(SplitMix(1234567, 2), 9817491932198370423ULL);
}

TEST(OpenUniform, StaysInside) {
  EXPECT_GT(OpenUniform(0), 0.0);
  EXPECT_LT(OpenUniform((std::uint64_t{1} << 52) - 1), 1.0);
}

// Equal cells of neighbouring indices and dimensions together: no structure between them.
TEST(CounterRandom, IsUniformInPairs) {
  for (const std::uint64_t seed : {0, 1, 2}) {
    const CounterRandom random(seed, 1);
    std::vector<double> by_dimension(256), by_index(256);
    constexpr int kPairs = 25600;
    for (std::uint64_t i = 0; i < kPairs; ++i) {
      const int a = static_cast<int>(16 * random.Uniform(i, 0));
      ++by_dimension[16 * a + static_cast<int>(16 * random.Uniform(i, 1))];
      ++by_index[16 * a + static_cast<int>(16 * random.Uniform(i + 1, 0))];
    }
    for (const auto& counts : {by_dimension, by_index}) {
      double chi_square = 0.0;
      for (double n : counts) chi_square += (n - 100.0) * (n - 100.0) / 100.0;
      EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, 255)) << seed;
      EXPECT_GT(chi_square, ChiSquareQuantile(0.0001, 255)) << seed;
    }
  }
}

TEST(CounterRandom, NormalsAreStandardAndIndependent) {
  const CounterRandom random(4, 2);
  constexpr int kN = 40000;
  std::vector<double> cells(64);  // eight equal cells each of two scores
  double fourth = 0.0;
  for (std::uint64_t i = 0; i < kN; ++i) {
    double z[3];
    random.Normals(i, z);
    const auto cell = [](double x) { return static_cast<std::size_t>(8.0 * NormalCdf(x)); };
    ++cells[8 * cell(z[0]) + cell(z[1])];
    fourth += std::pow(z[2], 4.0) / kN;
  }
  double chi_square = 0.0;
  for (double n : cells) chi_square += (n - kN / 64.0) * (n - kN / 64.0) / (kN / 64.0);
  EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, 63));
  EXPECT_NEAR(fourth, 3.0, 4.0 * std::sqrt(96.0 / kN));
}

TEST(KeyedPermutation, IsOneForEverySize) {
  for (std::uint64_t size = 1; size <= 2000; ++size) {
    const KeyedPermutation permutation(size, 17 * size);
    std::vector<bool> seen(size);
    for (std::uint64_t i = 0; i < size; ++i) {
      const std::uint64_t image = permutation(i);
      ASSERT_LT(image, size);
      ASSERT_FALSE(seen[image]) << size;
      seen[image] = true;
    }
  }
}

TEST(KeyedPermutation, HoldsForSizesNearTheLimits) {
  for (const std::uint64_t size : {(1ULL << 40) - 87, 1ULL << 63, (1ULL << 63) - 25}) {
    const KeyedPermutation permutation(size, 3);
    std::map<std::uint64_t, int> images;
    for (std::uint64_t i = 0; i < 1000; ++i) {
      const std::uint64_t image = permutation(size - 1 - i);
      ASSERT_LT(image, size);
      EXPECT_EQ(images[image]++, 0);
    }
  }
}

// All orders of a few are equally likely over the keys; of many, where any one goes is uniform and
// does not tell where the next goes.
TEST(KeyedPermutation, HasEveryOrderAlike) {
  for (const std::uint64_t size : {3, 4, 5}) {
    std::map<std::vector<std::uint64_t>, int> counts;
    double orders = 1.0;
    for (std::uint64_t i = 2; i <= size; ++i) orders *= static_cast<double>(i);
    constexpr double kEach = 100.0;
    const CounterRandom keys(5, 9);
    for (int k = 0; k < kEach * orders; ++k) {
      const KeyedPermutation permutation(size, keys.Bits(static_cast<std::uint64_t>(k), 0));
      std::vector<std::uint64_t> order(size);
      for (std::uint64_t i = 0; i < size; ++i) order[i] = permutation(i);
      ++counts[order];
    }
    EXPECT_EQ(static_cast<double>(counts.size()), orders);
    double chi_square = 0.0;
    for (const auto& [order, n] : counts) chi_square += (n - kEach) * (n - kEach) / kEach;
    EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, orders - 1)) << size;
  }
}

TEST(KeyedPermutation, PairsAreUniform) {
  constexpr std::uint64_t kSize = 30;
  std::vector<double> counts(kSize * kSize);
  const CounterRandom keys(6, 9);
  constexpr double kEach = 50.0;
  for (std::uint64_t k = 0; k < kEach * kSize * (kSize - 1); ++k) {
    const KeyedPermutation permutation(kSize, keys.Bits(k, 0));
    ++counts[kSize * permutation(4) + permutation(5)];
  }
  double chi_square = 0.0;
  for (std::uint64_t i = 0; i < kSize * kSize; ++i) {
    if (i / kSize != i % kSize) chi_square += (counts[i] - kEach) * (counts[i] - kEach) / kEach;
  }
  EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, kSize * (kSize - 1) - 1));
}

}  // namespace
}  // namespace unfurl::campaign::counter_random_test
