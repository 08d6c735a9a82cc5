#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

/// A quantile with its distribution-free interval, from order statistics.
struct QuantileEstimate {
  double p = 0.5;  // P(X <= value)
  double value = 0.0;
  Interval interval;
};

/// An interval that holds at least `content` of the distribution, with the summary's confidence.
struct ToleranceEstimate {
  double content = 0.95;
  /// From order statistics, of any distribution; none where runs are too few for it.
  std::optional<Interval> two_sided;
  std::optional<double> lower, upper;  // one-sided bounds
  std::size_t runs_two_sided = 0;      // fewest runs that give one [Wilks 1941]
  std::size_t runs_one_sided = 0;
  /// mean -+ k sigma, only where the values pass the test of normality.
  std::optional<Interval> normal;
};

/// Counts of equal bins.
struct Histogram {
  double low = 0.0, width = 0.0;  // of the first bin; width 0 where all values are equal
  std::vector<std::size_t> counts;
};

/// What runs say of one response.
struct Summary {
  std::size_t n = 0;       // finite values
  std::size_t failed = 0;  // NaN: runs without this response; left out of all else
  int blocks = 0;          // of the design; 0: independent runs
  double confidence = 0.95;

  double mean = 0.0, mean_error = 0.0;
  Interval mean_interval;  // MeanInterval, or Student's from the scatter of the blocks' means
  double sigma = 0.0;
  Interval sigma_interval;
  double minimum = 0.0, maximum = 0.0, median = 0.0;
  double skewness = 0.0, excess_kurtosis = 0.0;
  /// Those of 0.001, 0.01, 0.05, 0.1, 0.25, 0.5 and so on that the runs can enclose.
  std::vector<QuantileEstimate> quantiles;
  std::vector<ToleranceEstimate> tolerance;  // of contents 0.9, 0.95, 0.99, 0.999
  double normality_p = 0.0;                  // Anderson and Darling's
  Histogram histogram;
  /// Half width of the band about the empirical distribution function [-].
  double distribution_band = 1.0;
  /// What a reader must know: failed runs, conservative intervals, too few runs.
  std::vector<std::string> notes;
};

/// `values`: one a run, NaN where the run failed. `block`: of each run (Design::Block); empty for
/// independent runs. With blocks the mean's error is that of the blocks' scatter; the other
/// intervals are those of independent runs, which are too wide for such designs, and say so.
/// Throws Error for an infinite value, or lists of unequal length.
Summary Summarise(std::span<const double> values, std::span<const int> block = {},
                  double confidence = 0.95);

/// A probability from yes and no.
struct ProportionEstimate {
  std::size_t n = 0, yes = 0, failed = 0;
  double value = 0.0;
  double error = 0.0;  // standard error: binomial, or from blocks
  Interval interval;   // Clopper and Pearson's: conservative for Latin and Sobol designs
};

/// `values`: not zero is yes, NaN a failed run, which is left out and counted.
ProportionEstimate Proportion(std::span<const double> values, std::span<const int> block = {},
                              double confidence = 0.95);

/// Mean and standard error from replicates: blocks weighted by their size.
struct BlockMean {
  double mean = 0.0, error = 0.0;
  int blocks = 0;  // with values; the error has one degree of freedom less
};
BlockMean MeanOfBlocks(std::span<const double> values, std::span<const int> block);

}  // namespace unfurl::campaign
