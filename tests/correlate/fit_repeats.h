#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "base/statistics.h"
#include "base/worker_pool.h"
#include "correlate/fit/fit.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate {

inline std::vector<Parameter> TwoLinkParameters() {
  std::vector<Parameter> all(2);
  Parameter& frequency = all[0];
  frequency.name = "frequency";
  frequency.unit = "Hz";
  frequency.start = 0.95;
  frequency.low = 0.5;
  frequency.high = 2.0;
  Parameter& decay = all[1];
  decay.name = "decay";
  decay.unit = "1/s";
  decay.start = 0.5;
  decay.low = 0.01;
  decay.high = 5.0;
  decay.log = true;
  return all;
}

// Few samples, so that hundreds of fits stay cheap.
inline Trial SparseTrial() {
  Trial trial = TiltedTrial();
  trial.duration = 3.0;
  trial.step = 0.025;
  return trial;
}

struct Coverage {
  int trials = 0;
  int covered[2] = {0, 0};  // by +-1.96 standard errors
  int covered_white[2] = {0, 0};
  std::vector<double> z[2];
  int beyond_covariances = 0;  // trials whose residuals their covariances do not explain
  int unexplained = 0;         // and neither does noise
};

// How often the intervals of these fits of the two-link arm hold; one that is not usable is a miss.
inline Coverage CountCovered(const std::vector<FitResult>& fits) {
  constexpr double k95 = 1.959964;
  Coverage out;
  out.trials = static_cast<int>(fits.size());
  for (const FitResult& fit : fits) {
    if (!fit.Usable()) continue;  // counts as a miss
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      const double error = e.value - TwoLink::Truth()[j];
      out.covered[j] += std::abs(error) <= k95 * e.sigma ? 1 : 0;
      out.covered_white[j] += std::abs(error) <= k95 * e.sigma_white ? 1 : 0;
      out.z[j].push_back(error / e.sigma);
    }
    const Explained outcome = fit.trials[0].goodness.outcome;
    out.beyond_covariances += outcome != Explained::kYes ? 1 : 0;
    out.unexplained += outcome == Explained::kNo ? 1 : 0;
  }
  return out;
}

// A fit of one trial, on this thread.
inline FitResult FitOneTrial(const Model& model, const Observations& data,
                             std::vector<Parameter> parameters, bool profile = false) {
  FitProblem problem;
  problem.parameters = std::move(parameters);
  problem.trials.resize(1);
  problem.trials[0].model = &model;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.profile.wanted = profile;
  options.workers = 1;
  return Fit(problem, options);
}

// A fit of frequency and decay.
inline FitResult FitTwoLink(const Model& model, const Observations& data, bool profile) {
  return FitOneTrial(model, data, TwoLinkParameters(), profile);
}

// Repeats fits of TwoLink to noisy trials of it.
inline Coverage Repeat(const Trial& trial, int seeds, std::uint64_t first) {
  const TwoLink model;
  std::vector<FitResult> fits(static_cast<std::size_t>(seeds));
  ParallelFor(fits.size(), 0, [&](std::size_t i) {
    Rng rng(first + i);
    const Observations data = Record(model, TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng);
    fits[i] = FitTwoLink(model, data, true);
  });
  return CountCovered(fits);
}

inline void ExpectHonest(const Coverage& c, double low = 0.95, double high = 0.95) {
  fmt::print(
      "covered {} and {} of {}, of white errors {} and {}; not as the covariances say {}, nor as "
      "noise {}\n",
      c.covered[0], c.covered[1], c.trials, c.covered_white[0], c.covered_white[1],
      c.beyond_covariances, c.unexplained);
  for (std::size_t j = 0; j < 2; ++j) {
    // At 99.9%, so that eight such intervals fail by chance once in a hundred code changes at most;
    // the seeds are fixed, so a given code either passes or not.
    const auto [from, to] = BinomialInterval(static_cast<std::size_t>(c.covered[j]),
                                             static_cast<std::size_t>(c.trials), 0.999);
    EXPECT_LE(from, high) << "parameter " << j << ": " << c.covered[j] << " of " << c.trials;
    EXPECT_GE(to, low) << "parameter " << j << ": " << c.covered[j] << " of " << c.trials;
  }
}

}  // namespace unfurl::correlate
