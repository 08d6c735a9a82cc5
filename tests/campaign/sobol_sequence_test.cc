#include "campaign/statistics/sobol_sequence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::campaign::sobol_sequence_test {
namespace {

// The first points of three dimensions as printed with the direction numbers of Joe and Kuo.
TEST(SobolSequence, EqualsItsPrintedBeginning) {
  const std::vector<std::vector<double>> printed = {{0, 0, 0},
                                                    {0.5, 0.5, 0.5},
                                                    {0.75, 0.25, 0.25},
                                                    {0.25, 0.75, 0.75},
                                                    {0.375, 0.375, 0.625},
                                                    {0.875, 0.875, 0.125},
                                                    {0.625, 0.125, 0.875},
                                                    {0.125, 0.625, 0.375}};
  const SobolSequence sequence(3);
  for (std::size_t i = 0; i < printed.size(); ++i) {
    for (int d = 0; d < 3; ++d) {
      EXPECT_EQ(std::ldexp(static_cast<double>(sequence.Digits(i, d)), -SobolSequence::kBits),
                printed[i][static_cast<std::size_t>(d)])
          << i << " " << d;
    }
  }
}

// The first two dimensions are a (0, m, 2)-net: one point in every elementary box of area 2^-m.
// Each single dimension has one point a cell, whatever the dimension. Scrambling keeps both.
TEST(SobolSequence, IsANetScrambledOrNot) {
  constexpr int kM = 8, kN = 1 << kM;
  const SobolSequence sequence(40);
  for (const std::uint64_t first : {0, 3 * kN}) {
    for (int wide = 0; wide <= kM; ++wide) {
      std::set<int> boxes;
      for (std::uint64_t i = first; i < first + kN; ++i) {
        const int x = static_cast<int>(std::ldexp(sequence.Scrambled(i, 0, 11), wide));
        const int y = static_cast<int>(std::ldexp(sequence.Scrambled(i, 1, 12), kM - wide));
        boxes.insert((x << (kM - wide)) + y);
      }
      EXPECT_EQ(boxes.size(), kN) << wide;
    }
    for (int d = 0; d < 40; ++d) {
      std::set<int> cells;
      for (std::uint64_t i = first; i < first + kN; ++i) {
        cells.insert(static_cast<int>(kN * sequence.Scrambled(i, d, 13)));
      }
      EXPECT_EQ(cells.size(), kN) << d;
    }
  }
}

// Over scramblings each point is uniform, and the square of the error of a mean falls as n^-3 for
// a smooth function, where that of random points falls as n^-1 [Owen 1997].
TEST(SobolSequence, ScramblingIsUniformAndFast) {
  const SobolSequence sequence(2);
  std::vector<double> cells(64);
  std::vector<double> square(2);
  constexpr int kRepeats = 6400;
  for (int k = 0; k < kRepeats; ++k) {
    ++cells[static_cast<std::size_t>(64 * sequence.Scrambled(0, 0, static_cast<std::uint64_t>(k)))];
  }
  double chi_square = 0.0;
  for (double n : cells) chi_square += (n - 100.0) * (n - 100.0) / 100.0;
  EXPECT_LT(chi_square, ChiSquareQuantile(0.9999, 63));
  for (int k = 0; k < 200; ++k) {
    for (int size = 0; size < 2; ++size) {
      const int n = size == 0 ? 16 : 256;
      double sum = 0.0;
      for (int i = 0; i < n; ++i) {
        const std::uint64_t key = static_cast<std::uint64_t>(k);
        sum += std::exp(sequence.Scrambled(i, 0, 2 * key)) *
               std::exp(sequence.Scrambled(i, 1, 2 * key + 1));
      }
      const double exact = (std::exp(1.0) - 1.0) * (std::exp(1.0) - 1.0);
      square[static_cast<std::size_t>(size)] += std::pow(sum / n - exact, 2) / 200;
    }
  }
  // 4^3 a factor of 4 in n, with a logarithm that the two dimensions bring; random points give 16.
  EXPECT_GT(square[0] / square[1], 800.0);
}

TEST(SobolSequence, RefusesWhatHasNoDirectionNumbers) {
  EXPECT_THROW(SobolSequence(0), Error);
  EXPECT_THROW(SobolSequence(SobolSequence::kMostDimensions + 1), Error);
  const SobolSequence most(SobolSequence::kMostDimensions);
  EXPECT_GT(most.Scrambled((1ULL << 52) - 1, SobolSequence::kMostDimensions - 1, 1), 0.0);
}

}  // namespace
}  // namespace unfurl::campaign::sobol_sequence_test
