#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <ostream>

#include "base/random.h"
#include "base/statistics.h"
#include "correlate/hierarchy/random_effect.h"

namespace unfurl::correlate {

// Synthetic campaigns: trials of a structure whose quantity scatters, each with an error of its own
// of 1, or of 0.5 to 2 with steps of one ratio.
struct CampaignCase {
  Eigen::Index trials = 8;
  double scatter = 1.0;  // standard deviation, in the errors' own
  bool unequal = false;
};

inline void PrintTo(const CampaignCase& c, std::ostream* out) {
  *out << c.trials << " trials, scatter " << c.scatter << (c.unequal ? ", unequal" : "");
}

// In how many of them each interval held the truth.
struct CoverageCount {
  std::size_t mean = 0, scatter = 0, next = 0, left_out = 0;
};

inline bool Inside(const NormalMixture& m, double x) {
  const double p = m.Cdf(x);
  return p > 0.025 && p < 0.975;
}

inline CoverageCount CoverageOf(const CampaignCase& c, std::size_t campaigns) {
  Rng rng(1000 + static_cast<std::uint64_t>(c.trials));
  const ScatterLevels levels(c.trials), fewer(c.trials - 1);
  CoverageCount count;
  Eigen::VectorXd variance = Eigen::VectorXd::Ones(c.trials), y(c.trials);
  for (Eigen::Index i = 0; c.unequal && i < c.trials; ++i) {
    variance(i) = std::pow(16.0, static_cast<double>(i) / static_cast<double>(c.trials - 1) - 0.5);
  }
  constexpr double kShared = 0.04;  // variance of an error that all trials have
  for (std::size_t k = 0; k < campaigns; ++k) {
    const double common = std::sqrt(kShared) * rng.Normal();
    for (Eigen::Index i = 0; i < c.trials; ++i) {
      y(i) = common + c.scatter * rng.Normal() + std::sqrt(variance(i)) * rng.Normal();
    }
    const RandomEffect effect(y, variance, kShared, levels);
    count.mean += Inside(effect.Mean(), 0.0);
    const Interval scatter = effect.Scatter95();
    count.scatter += scatter.low <= c.scatter && c.scatter <= scatter.high;
    count.next += Inside(effect.Next(), c.scatter * rng.Normal());
    const Eigen::Index last = c.trials - 1;
    if (c.trials > 3) {
      const RandomEffect others(y.head(last), variance.head(last), 0.0, fewer);
      count.left_out += Inside(others.NextEstimate(variance(last)), y(last));
    } else {
      count.left_out += LeaveOneOut(y, variance).back().p > 0.05;
    }
  }
  return count;
}

// A proportion that can be within [low, high]: by its Clopper-Pearson interval of 99.9%.
inline void ExpectWithin(std::size_t successes, std::size_t trials, double low, double high) {
  const auto [from, to] = BinomialInterval(successes, trials, 0.999);
  EXPECT_LE(from, high) << successes << " of " << trials;
  EXPECT_GE(to, low) << successes << " of " << trials;
}

}  // namespace unfurl::correlate
