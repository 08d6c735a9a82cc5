#include "campaign/statistics/sobol_sequence.h"

#include <fmt/format.h>

#include <bit>
#include <boost/random/sobol.hpp>

#include "base/error.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

static_assert(SobolSequence::kMostDimensions == boost::random::default_sobol_table::max_dimension);

SobolSequence::SobolSequence(int dimensions) : dimensions_(dimensions) {
  if (dimensions < 1 || dimensions > kMostDimensions) {
    throw Error(
        fmt::format("a Sobol sequence of {} dimensions", dimensions), "",
        fmt::format("there are direction numbers for 1 to {}; take a Latin or random design",
                    kMostDimensions));
  }
  // Point n of the sequence is the sum modulo 2 of the direction numbers at the ones of n's Gray
  // code [Antonov and Saleev 1979]. Point 2^j has ones at j and j - 1 of it.
  directions_.resize(static_cast<std::size_t>(dimensions) * kBits);
  boost::random::sobol_engine<std::uint64_t, kBits> engine(static_cast<std::size_t>(dimensions));
  for (int j = 0; j < kBits; ++j) {
    engine.seed((std::uint64_t{1} << j) - 1);  // the engine leaves out the point 0
    for (int d = 0; d < dimensions; ++d) {
      std::uint64_t* v = &directions_[static_cast<std::size_t>(d) * kBits];
      v[j] = engine() ^ (j == 0 ? 0 : v[j - 1]);
    }
  }
}

std::uint64_t SobolSequence::Digits(std::uint64_t index, int dimension) const {
  const std::uint64_t* v = &directions_[static_cast<std::size_t>(dimension) * kBits];
  std::uint64_t x = 0;
  for (std::uint64_t gray = index ^ (index >> 1); gray != 0; gray &= gray - 1) {
    x ^= v[std::countr_zero(gray)];
  }
  return x;
}

double SobolSequence::Scrambled(std::uint64_t index, int dimension, std::uint64_t key) const {
  const std::uint64_t x = Digits(index, dimension);
  std::uint64_t flips = 0;
  for (int k = 0; k < kBits; ++k) {
    // The node of the tree of digits: a one, and the k digits above this one.
    const std::uint64_t node = (std::uint64_t{1} << k) | (x >> (kBits - k));
    flips |= (SplitMix(key, node) >> 63) << (kBits - 1 - k);
  }
  return OpenUniform(x ^ flips);
}

}  // namespace unfurl::campaign
