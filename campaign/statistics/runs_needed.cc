#include "campaign/statistics/runs_needed.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/statistics.h"
#include "campaign/statistics/summary.h"

namespace unfurl::campaign {

namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

AnswerAt QuantileAt(const Wanted& wanted, std::span<const double> values) {
  std::vector<double> sorted;
  for (double v : values) {
    if (!std::isnan(v)) sorted.push_back(v);
  }
  std::sort(sorted.begin(), sorted.end());
  AnswerAt at{.n = values.size(), .value = Quantile(sorted, wanted.p), .half_width = kUnbounded};
  if (const auto ranks = QuantileRanks(sorted.size(), wanted.p, wanted.confidence)) {
    at.half_width = (sorted[ranks->second - 1] - sorted[ranks->first - 1]) / 2.0;
  }
  return at;
}

// Mean and interval without the rest of a summary.
AnswerAt MeanAt(const Wanted& wanted, std::span<const double> values, std::span<const int> block) {
  std::vector<double> x;
  std::vector<int> of;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isnan(values[i])) continue;
    x.push_back(values[i]);
    if (!block.empty()) of.push_back(block[i]);
  }
  AnswerAt at{.n = values.size(), .value = Mean(x)};
  const BlockMean mean = MeanOfBlocks(x, of);
  at.half_width =
      mean.blocks >= 2
          ? StudentQuantile(0.5 + wanted.confidence / 2.0, mean.blocks - 1.0) * mean.error
          : MeanInterval(x, wanted.confidence).HalfWidth();
  return at;
}

AnswerAt AnswerOf(const Wanted& wanted, std::span<const double> values,
                  std::span<const int> block) {
  if (wanted.kind == AnswerKind::kQuantile) return QuantileAt(wanted, values);
  if (wanted.kind == AnswerKind::kMean) return MeanAt(wanted, values, block);
  const ProportionEstimate p = Proportion(values, block, wanted.confidence);
  return {.n = values.size(), .value = p.value, .half_width = p.interval.HalfWidth()};
}

// Runs at which Clopper and Pearson's interval of the share found is as narrow as wanted.
double RunsOfProportion(double share, const Wanted& wanted) {
  const auto wide = [&](double n) {
    const auto yes = static_cast<std::size_t>(std::llround(share * n));
    const auto [low, high] = BinomialInterval(yes, static_cast<std::size_t>(n), wanted.confidence);
    return (high - low) / 2.0 > wanted.half_width;
  };
  constexpr double kMost = 1e15;  // counts beyond it are not whole in a double's quotient
  double high = 1.0;
  while (high < kMost && wide(high)) high *= 2.0;
  double low = high / 2.0;
  while (high - low > 1.0 && high - low > 1e-6 * high) {
    const double middle = std::floor((low + high) / 2.0);
    (wide(middle) ? low : high) = middle;
  }
  return high;
}

double RunsUntil(const Wanted& wanted, const AnswerAt& now) {
  if (wanted.kind == AnswerKind::kProbability) return RunsOfProportion(now.value, wanted);
  if (std::isfinite(now.half_width)) {
    const double ratio = now.half_width / wanted.half_width;
    return std::ceil(static_cast<double>(now.n) * ratio * ratio);
  }
  if (wanted.kind == AnswerKind::kMean) return 2.0;
  // As many as the quantile needs to have order statistics on both sides.
  std::size_t n = std::max<std::size_t>(now.n, 1);
  while (!QuantileRanks(n, wanted.p, wanted.confidence)) n += n / 8 + 1;
  return static_cast<double>(n);
}

double SlopeOf(const std::vector<AnswerAt>& history) {
  std::vector<double> x, y;
  for (const AnswerAt& at : history) {
    if (!std::isfinite(at.half_width) || !(at.half_width > 0.0)) continue;
    x.push_back(std::log(static_cast<double>(at.n)));
    y.push_back(std::log(at.half_width));
  }
  constexpr std::size_t kLeast = 3;  // two sizes always lie on a line
  if (x.size() < kLeast) return std::nan("");
  double product = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) product += (x[i] - Mean(x)) * (y[i] - Mean(y));
  return product / (Variance(x) * static_cast<double>(x.size() - 1));
}

}  // namespace

RunsEstimate RunsNeeded(const Wanted& wanted, std::span<const double> values,
                        std::span<const int> block) {
  if (!(wanted.half_width >= 0.0) || !(wanted.confidence > 0.0 && wanted.confidence < 1.0) ||
      !(wanted.p > 0.0 && wanted.p < 1.0)) {
    throw Error("an answer wanted with a half width, confidence or quantile that is none", "",
                "give a half width above zero, the others between 0 and 1");
  }
  RunsEstimate estimate;
  for (const std::size_t part : {16, 8, 4, 2, 1}) {
    const std::size_t n = values.size() / part;
    if (n == 0) continue;
    estimate.history.push_back(
        AnswerOf(wanted, values.first(n), block.empty() ? block : block.first(n)));
  }
  estimate.slope = SlopeOf(estimate.history);
  if (!(wanted.half_width > 0.0)) return estimate;
  const AnswerAt now =
      estimate.history.empty() ? AnswerAt{.half_width = kUnbounded} : estimate.history.back();
  estimate.met = now.half_width <= wanted.half_width;
  estimate.runs = estimate.met ? static_cast<double>(now.n) : RunsUntil(wanted, now);
  return estimate;
}

}  // namespace unfurl::campaign
