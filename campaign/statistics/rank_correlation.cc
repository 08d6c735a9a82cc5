#include "campaign/statistics/rank_correlation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "base/statistics.h"

namespace unfurl::campaign {

namespace {

constexpr std::size_t kFewestPairs = 5;  // pairs: below, the variance's n - 3 means nothing

// From 1, equal values their mean.
std::vector<double> Ranks(std::span<const double> x) {
  std::vector<std::size_t> order(x.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return x[i] < x[j]; });
  std::vector<double> ranks(x.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t last = i;
    while (last + 1 < order.size() && x[order[last + 1]] == x[order[i]]) ++last;
    const double mean = 0.5 * static_cast<double>(i + last) + 1.0;
    for (; i <= last; ++i) ranks[order[i]] = mean;
  }
  return ranks;
}

}  // namespace

double RankCorrelation(std::span<const double> a, std::span<const double> b) {
  const std::vector<double> ra = Ranks(a), rb = Ranks(b);
  const double middle = 0.5 * (static_cast<double>(a.size()) + 1.0);
  double aa = 0.0, bb = 0.0, ab = 0.0;
  for (std::size_t i = 0; i < ra.size(); ++i) {
    aa += (ra[i] - middle) * (ra[i] - middle);
    bb += (rb[i] - middle) * (rb[i] - middle);
    ab += (ra[i] - middle) * (rb[i] - middle);
  }
  return aa > 0.0 && bb > 0.0 ? std::clamp(ab / std::sqrt(aa * bb), -1.0, 1.0) : 0.0;
}

Interval RankCorrelationInterval(double r, std::size_t n, double confidence) {
  if (n < kFewestPairs) return {-1.0, 1.0};
  if (std::abs(r) >= 1.0) return {r, r};
  const double z = NormalQuantile(0.5 + 0.5 * confidence);
  const double half = z * std::sqrt((1.0 + 0.5 * r * r) / (static_cast<double>(n) - 3.0));
  return {std::tanh(std::atanh(r) - half), std::tanh(std::atanh(r) + half)};
}

}  // namespace unfurl::campaign
