#include "campaign/statistics/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/count.h"
#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

// Values that are numbers, with their blocks.
struct Sample {
  std::vector<double> x;
  std::vector<int> block;
  std::size_t failed = 0;
};

Sample Finite(std::span<const double> values, std::span<const int> block) {
  if (!block.empty() && block.size() != values.size()) {
    throw Error(fmt::format("{} values with {} blocks", values.size(), block.size()), "",
                "give each value its block, or none");
  }
  Sample sample;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) {
      ++sample.failed;
      continue;
    }
    if (std::isinf(values[i])) {
      throw Error(fmt::format("an infinite value of run {}", i), "",
                  "count the run as failed: NaN");
    }
    sample.x.push_back(values[i]);
    if (!block.empty()) sample.block.push_back(block[i]);
  }
  return sample;
}

void CheckConfidence(double confidence) {
  if (confidence > 0.0 && confidence < 1.0) return;
  throw Error(fmt::format("the confidence {}", confidence), "", "give one between 0 and 1");
}

// Linear between order statistics of sorted values.
double SortedQuantile(std::span<const double> sorted, double p) {
  const double at = p * static_cast<double>(sorted.size() - 1);
  const std::size_t below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

void AddQuantiles(std::span<const double> sorted, Summary* summary) {
  for (const double p : {0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 0.999}) {
    const auto ranks = QuantileRanks(sorted.size(), p, summary->confidence);
    if (!ranks) continue;
    summary->quantiles.push_back(
        {p, SortedQuantile(sorted, p), {sorted[ranks->first - 1], sorted[ranks->second - 1]}});
  }
}

void AddTolerance(std::span<const double> sorted, Summary* summary) {
  // Below this p-value the values are not taken for normal: the usual level of a test. A wrong
  // "normal" is the worse error of the two, and the interval of order statistics is always there.
  constexpr double kNormal = 0.05;
  const std::size_t n = sorted.size();
  for (const double content : {0.9, 0.95, 0.99, 0.999}) {
    ToleranceEstimate t;
    t.content = content;
    t.runs_one_sided = WilksRuns(content, summary->confidence, 1);
    t.runs_two_sided = WilksRuns(content, summary->confidence, 2);
    if (const auto off = WilksLeftOut(n, content, summary->confidence, 2)) {
      t.two_sided = Interval{sorted[*off], sorted[n - 1 - *off]};
    }
    if (const auto off = WilksLeftOut(n, content, summary->confidence, 1)) {
      t.lower = sorted[*off];
      t.upper = sorted[n - 1 - *off];
    }
    if (summary->normality_p > kNormal) {
      const double k = NormalToleranceFactor(n, content, summary->confidence);
      t.normal = Interval{summary->mean - k * summary->sigma, summary->mean + k * summary->sigma};
    }
    summary->tolerance.push_back(t);
  }
}

// Bins of the width of Freedman and Diaconis (1981).
Histogram HistogramOf(std::span<const double> sorted) {
  constexpr double kFewest = 5.0, kMost = 200.0;  // bins that a picture of a page's width can show
  Histogram histogram{.low = sorted.front()};
  const double range = sorted.back() - sorted.front();
  if (!(range > 0.0)) {
    histogram.counts = {sorted.size()};
    return histogram;
  }
  const double quartiles = SortedQuantile(sorted, 0.75) - SortedQuantile(sorted, 0.25);
  const double width = 2.0 * quartiles / std::cbrt(static_cast<double>(sorted.size()));
  const double bins = width > 0.0 ? std::clamp(std::ceil(range / width), kFewest, kMost) : kMost;
  histogram.width = range / bins;
  histogram.counts.resize(static_cast<std::size_t>(bins));
  for (double x : sorted) {
    const auto bin = static_cast<std::size_t>((x - histogram.low) / histogram.width);
    ++histogram.counts[std::min(bin, histogram.counts.size() - 1)];
  }
  return histogram;
}

void AddMoments(const Sample& sample, Summary* summary) {
  const std::span<const double> x = sample.x;
  const double n = static_cast<double>(x.size());
  summary->mean = Mean(x);
  summary->mean_error = std::sqrt(Variance(x) / n);
  summary->mean_interval = MeanInterval(x, summary->confidence);
  summary->sigma = std::sqrt(Variance(x));
  summary->sigma_interval = SigmaInterval(x, summary->confidence);
  const double deviation = summary->sigma * std::sqrt((n - 1.0) / n);  // with n
  if (!(deviation > 0.0)) return;
  double third = 0.0, fourth = 0.0;
  for (double v : x) {
    const double d = (v - summary->mean) / deviation;
    third += d * d * d / n;
    fourth += d * d * d * d / n;
  }
  summary->skewness = third;
  summary->excess_kurtosis = fourth - 3.0;
}

void AddBlocks(const Sample& sample, Summary* summary) {
  const BlockMean mean = MeanOfBlocks(sample.x, sample.block);
  summary->blocks = mean.blocks;
  if (mean.blocks < 2) return;
  summary->mean_error = mean.error;
  const double t = StudentQuantile(0.5 + summary->confidence / 2.0, mean.blocks - 1.0);
  summary->mean_interval = {mean.mean - t * mean.error, mean.mean + t * mean.error};
  summary->notes.push_back(fmt::format(
      "the mean's error is that of {} replicates of the design; intervals of sigma, quantiles and "
      "tolerance are those of independent runs, and too wide for this design",
      mean.blocks));
}

}  // namespace

BlockMean MeanOfBlocks(std::span<const double> values, std::span<const int> block) {
  const int most = block.empty() ? -1 : *std::max_element(block.begin(), block.end());
  std::vector<double> sum(static_cast<std::size_t>(most + 1)), count(sum.size());
  for (std::size_t i = 0; i < block.size(); ++i) {
    sum[static_cast<std::size_t>(block[i])] += values[i];
    ++count[static_cast<std::size_t>(block[i])];
  }
  BlockMean result;
  double total = 0.0;
  for (std::size_t b = 0; b < sum.size(); ++b) {
    result.mean += sum[b];
    total += count[b];
    if (count[b] > 0.0) ++result.blocks;
  }
  if (total > 0.0) result.mean /= total;
  if (result.blocks < 2) return result;
  // Variance of a weighted mean from the scatter of what it is made of; with equal blocks that of
  // their means over their number.
  double square = 0.0;
  for (std::size_t b = 0; b < sum.size(); ++b) {
    const double off = (sum[b] - count[b] * result.mean) / total;
    square += off * off;
  }
  result.error = std::sqrt(square * result.blocks / (result.blocks - 1.0));
  return result;
}

Summary Summarise(std::span<const double> values, std::span<const int> block, double confidence) {
  CheckConfidence(confidence);
  Sample sample = Finite(values, block);
  Summary summary;
  summary.n = sample.x.size();
  summary.failed = sample.failed;
  summary.confidence = confidence;
  if (sample.failed > 0) {
    summary.notes.push_back(
        fmt::format("{} of {} failed: what is said holds for runs that do not fail", sample.failed,
                    Counted(values.size(), "run")));
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (summary.n == 0) {
    summary.mean_interval = {-kInfinity, kInfinity};
    summary.sigma_interval = {0.0, kInfinity};
    summary.notes.emplace_back("no run has a value");
    return summary;
  }
  AddMoments(sample, &summary);
  if (!sample.block.empty()) AddBlocks(sample, &summary);
  std::sort(sample.x.begin(), sample.x.end());
  summary.minimum = sample.x.front();
  summary.maximum = sample.x.back();
  summary.median = SortedQuantile(sample.x, 0.5);
  summary.normality_p = NormalityP(sample.x);
  AddQuantiles(sample.x, &summary);
  AddTolerance(sample.x, &summary);
  summary.histogram = HistogramOf(sample.x);
  if (summary.n > 1 && summary.minimum == summary.maximum) {
    summary.notes.emplace_back("all values are equal: nothing is known of how they may scatter");
  }
  summary.distribution_band = DistributionBand(summary.n, confidence);
  return summary;
}

ProportionEstimate Proportion(std::span<const double> values, std::span<const int> block,
                              double confidence) {
  CheckConfidence(confidence);
  Sample sample = Finite(values, block);
  ProportionEstimate result;
  result.n = sample.x.size();
  result.failed = sample.failed;
  for (double& x : sample.x) {
    x = x != 0.0 ? 1.0 : 0.0;
    result.yes += x != 0.0 ? 1 : 0;
  }
  if (result.n == 0) {
    result.interval = {0.0, 1.0};
    return result;
  }
  const double n = static_cast<double>(result.n);
  result.value = static_cast<double>(result.yes) / n;
  result.error = std::sqrt(result.value * (1.0 - result.value) / n);
  const BlockMean mean = MeanOfBlocks(sample.x, sample.block);
  if (mean.blocks >= 2) result.error = mean.error;
  const auto [low, high] = BinomialInterval(result.yes, result.n, confidence);
  result.interval = {low, high};
  return result;
}

}  // namespace unfurl::campaign
