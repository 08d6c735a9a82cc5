#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

/// Shares of a response's variance that come of one input.
struct SobolIndex {
  double first = 0.0, first_error = 0.0;  // by the input alone
  double total = 0.0, total_error = 0.0;  // with all its interactions
  Interval first_interval, total_interval;
};

/// Indices of all inputs.
struct SobolIndices {
  std::vector<SobolIndex> inputs;
  std::size_t rows = 0;     // complete ones
  std::size_t dropped = 0;  // rows with a failed run
  double variance = 0.0;
  double sum_of_first = 0.0, sum_error = 0.0;  // 1 where inputs do not interact, else below
  bool usable = false;
  std::vector<std::string> notes;  // why not, or with what care
};

/// Indices from the runs of a Saltelli design in the order of their index (Design, kSaltelli;
/// NaN: failed, which drops its row; a last row that is not whole is left out), for independent
/// inputs. First-order by the estimator of Saltelli et al. (2010), total by Jansen's (1999), both
/// of centred values; errors by bootstrap over rows. Rows of a Sobol sequence scatter less than
/// independent ones, so the errors are then too large rather than too small.
///
/// Not usable: fewer than 20 whole rows, no variance, or indices outside 0 .. 1 or a sum of
/// first-order ones above 1 by more than their errors allow.
SobolIndices IndicesOfSaltelli(std::span<const double> values, int dimensions,
                               double confidence = 0.95, std::uint64_t seed = 1);

}  // namespace unfurl::campaign
