#pragma once

#include <span>

#include "campaign/statistics/intervals.h"

namespace unfurl::campaign {

/// Spearman's rank correlation of pairs, equal values sharing their mean rank: how far the one
/// rises or falls with the other, by whatever curve. 0 where one of them does not vary.
double RankCorrelation(std::span<const double> a, std::span<const double> b);

/// Its interval from n independent pairs, on Fisher's scale with the variance of Bonett and Wright
/// (2000), (1 + r^2 / 2) / (n - 3). -1 to 1 for fewer than five.
Interval RankCorrelationInterval(double r, std::size_t n, double confidence);

}  // namespace unfurl::campaign
