#include "campaign/statistics/sobol_indices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/count.h"
#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/counter_random.h"

namespace unfurl::campaign {

namespace {

// Resamples: the standard error of a standard error is 1 / sqrt(2 * 400) of it, 4%.
constexpr int kResamples = 400;
constexpr std::size_t kFewestRows = 20;  // resampling fewer rows repeats the same few sets
constexpr std::uint32_t kRows = 32;      // stream of random numbers

// What each row adds to the estimators' sums: for the variance, and two for each input.
struct Rows {
  std::size_t n = 0, d = 0;
  double scale = 1.0;                // largest distance from the mean: the unit of what follows
  std::vector<double> a, b;          // f(A), f(B), less their mean
  std::vector<double> first, total;  // n x d
};

Rows RowsOf(std::span<const double> values, std::size_t d, std::size_t* dropped) {
  Rows rows;
  rows.d = d;
  std::vector<std::span<const double>> whole;
  for (std::size_t at = 0; at + d + 2 <= values.size(); at += d + 2) {
    const auto row = values.subspan(at, d + 2);
    if (std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); })) {
      whole.push_back(row);
    } else {
      ++*dropped;
    }
  }
  rows.n = whole.size();
  double mean = 0.0;
  for (const auto& row : whole) mean += (row[0] + row[1]) / (2.0 * static_cast<double>(rows.n));
  double scale = 0.0;
  for (const auto& row : whole) {
    for (double v : row) scale = std::max(scale, std::abs(v - mean));
  }
  if (scale > 0.0) rows.scale = scale;
  for (const auto& row : whole) {
    rows.a.push_back((row[0] - mean) / rows.scale);
    rows.b.push_back((row[1] - mean) / rows.scale);
    for (std::size_t k = 0; k < d; ++k) {
      const double change = (row[2 + k] - row[0]) / rows.scale;
      rows.first.push_back(rows.b.back() * change);  // [Saltelli 2010, table 2 (b)]
      rows.total.push_back(0.5 * change * change);   // [Jansen 1999]
    }
  }
  return rows;
}

struct Estimate {
  std::vector<double> first, total;
  double sum = 0.0, variance = 0.0;
};

// `pick(r)`: the row that stands in place r of the sample.
template <typename Pick>
void EstimateOf(const Rows& rows, const Pick& pick, Estimate* e) {
  e->first.assign(rows.d, 0.0);
  e->total.assign(rows.d, 0.0);
  double mean = 0.0, square = 0.0;
  for (std::size_t r = 0; r < rows.n; ++r) {
    const std::size_t row = pick(r);
    mean += rows.a[row] + rows.b[row];
    square += rows.a[row] * rows.a[row] + rows.b[row] * rows.b[row];
    const double *first = &rows.first[row * rows.d], *total = &rows.total[row * rows.d];
    for (std::size_t k = 0; k < rows.d; ++k) {
      e->first[k] += first[k];
      e->total[k] += total[k];
    }
  }
  const double n = static_cast<double>(rows.n);
  mean /= 2.0 * n;
  e->variance = square / (2.0 * n) - mean * mean;
  e->sum = 0.0;
  for (std::size_t k = 0; k < rows.d; ++k) {
    e->first[k] /= n * e->variance;
    e->total[k] /= n * e->variance;
    e->sum += e->first[k];
  }
}

// Standard deviations over resamples of rows, with replacement.
Estimate BootstrapErrors(const Rows& rows, std::uint64_t seed) {
  const CounterRandom random(seed, kRows);
  std::vector<std::vector<double>> draws(2 * rows.d + 1);
  Estimate e;
  for (std::uint32_t k = 0; k < kResamples; ++k) {
    EstimateOf(
        rows,
        [&](std::size_t r) {
          return static_cast<std::size_t>(random.Uniform(r, k) * static_cast<double>(rows.n));
        },
        &e);
    if (!(e.variance > 0.0)) continue;
    for (std::size_t i = 0; i < rows.d; ++i) {
      draws[i].push_back(e.first[i]);
      draws[rows.d + i].push_back(e.total[i]);
    }
    draws.back().push_back(e.sum);
  }
  Estimate errors;
  for (std::size_t i = 0; i < rows.d; ++i) {
    errors.first.push_back(std::sqrt(Variance(draws[i])));
    errors.total.push_back(std::sqrt(Variance(draws[rows.d + i])));
  }
  errors.sum = std::sqrt(Variance(draws.back()));
  return errors;
}

// What cannot be true of indices, beyond their errors.
void Judge(double confidence, SobolIndices* result) {
  // Of 2 d indices one lies that far out by chance once in a thousand, and not once in twenty.
  const double far = NormalQuantile(1.0 - 0.0005 / static_cast<double>(2 * result->inputs.size()));
  result->usable = true;
  const auto fault = [&](const std::string& why) {
    result->usable = false;
    result->notes.push_back(why);
  };
  bool coarse = false;
  for (std::size_t k = 0; k < result->inputs.size(); ++k) {
    const SobolIndex& i = result->inputs[k];
    if (i.first < -far * i.first_error || i.first > 1.0 + far * i.first_error ||
        i.total > 1.0 + far * i.total_error) {
      fault(
          fmt::format("indices of input {} are outside 0 .. 1: {:.3g} and {:.3g}; inputs that "
                      "depend on each other, or runs in another order, do that",
                      k + 1, i.first, i.total));
    }
    if (i.first - i.total > far * std::hypot(i.first_error, i.total_error)) {
      fault(fmt::format("the total index of input {} is below its first-order one: {:.3g}, {:.3g}",
                        k + 1, i.total, i.first));
    }
    constexpr double kCoarse = 0.1;  // half width above which inputs cannot be ranked
    coarse |= i.first_interval.HalfWidth() > kCoarse || i.total_interval.HalfWidth() > kCoarse;
  }
  if (result->sum_of_first > 1.0 + far * result->sum_error) {
    fault(fmt::format("first-order indices add up to {:.3g} +- {:.2g}, more than all",
                      result->sum_of_first, result->sum_error));
  }
  if (coarse) {
    result->notes.push_back(
        fmt::format("some indices are no better known than +- 0.1 ({:g}%): "
                    "four times the rows halve that",
                    100.0 * confidence));
  }
}

}  // namespace

SobolIndices IndicesOfSaltelli(std::span<const double> values, int dimensions, double confidence,
                               std::uint64_t seed) {
  if (dimensions < 1 || !(confidence > 0.0 && confidence < 1.0)) {
    throw Error(fmt::format("indices of {} inputs with confidence {}", dimensions, confidence), "",
                "give one input or more, and a confidence between 0 and 1");
  }
  SobolIndices result;
  const Rows rows = RowsOf(values, static_cast<std::size_t>(dimensions), &result.dropped);
  result.rows = rows.n;
  if (result.dropped > 0) {
    result.notes.push_back(fmt::format("left out for a failed run: {} of {}", result.dropped,
                                       Counted(result.dropped + rows.n, "row")));
  }
  if (rows.n < kFewestRows) {
    result.notes.push_back(
        fmt::format("{}; {} are the least", Counted(rows.n, "whole row"), kFewestRows));
    return result;
  }
  Estimate e;
  EstimateOf(
      rows, [](std::size_t r) { return r; }, &e);
  result.variance = e.variance * rows.scale * rows.scale;
  if (!(e.variance > 0.0)) {
    result.notes.emplace_back("the response does not vary");
    return result;
  }
  const Estimate errors = BootstrapErrors(rows, seed);
  result.sum_of_first = e.sum;
  result.sum_error = errors.sum;
  const double z = NormalQuantile(0.5 + confidence / 2.0);
  for (std::size_t k = 0; k < rows.d; ++k) {
    SobolIndex i{.first = e.first[k],
                 .first_error = errors.first[k],
                 .total = e.total[k],
                 .total_error = errors.total[k]};
    i.first_interval = {i.first - z * i.first_error, i.first + z * i.first_error};
    i.total_interval = {i.total - z * i.total_error, i.total + z * i.total_error};
    result.inputs.push_back(i);
  }
  Judge(confidence, &result);
  return result;
}

}  // namespace unfurl::campaign
