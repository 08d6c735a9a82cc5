#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "base/worker_pool.h"
#include "correlate/hierarchy/from_fits.h"
#include "correlate/hierarchy/next_trial.h"
#include "tests/correlate/campaigns.h"
#include "tests/correlate/fit_repeats.h"

namespace unfurl::correlate {

// Campaigns of the two-link arm in closed form: frequency and the logarithm of the decay scatter by
// some times a trial's own error, and each trial is fitted from its noisy marks.
struct TwoLinkCampaigns {
  static constexpr Eigen::Index kTrials = 8;
  static constexpr double kFrequency = 0.003;  // scatter [Hz]
  static constexpr double kDecay = 0.05;       // of the logarithm [-]
  std::size_t mean[2] = {0, 0}, scatter[2] = {0, 0};
  std::size_t samples = 0, inside = 0;  // of the next trial's marks, with their own errors

  static std::vector<double> Draw(Rng& rng) {
    const std::vector<double> truth = TwoLink::Truth();
    return {truth[0] + kFrequency * rng.Normal(), truth[1] * std::exp(kDecay * rng.Normal())};
  }

  // One campaign; false: a trial was not usable.
  bool Add(std::uint64_t seed) {
    Rng rng(seed);
    const TwoLink model;
    const std::vector<Parameter> parameters = TwoLinkParameters();
    std::vector<Observations> data;
    std::vector<FitTrial> trials(kTrials);
    std::vector<FitResult> results;
    std::vector<FittedTrial> fits;
    Trial recording = SparseTrial();
    const std::vector<std::string> marks = {"base", "elbow", "tip"};
    for (Eigen::Index i = 0; i < kTrials; ++i) {
      data.push_back(Record(model, Draw(rng), marks, recording, rng));
      results.push_back(FitTwoLink(model, data.back(), false));
    }
    for (std::size_t i = 0; i < results.size(); ++i) {
      trials[i].name = "trial " + std::to_string(i + 1);
      fits.push_back({&trials[i], &results[i]});
    }
    const FittedTrials fitted = FromFits(parameters, fits);
    if (fitted.used.size() != static_cast<std::size_t>(kTrials)) return false;
    const Hierarchy h(fitted.problem);
    const double truth[] = {TwoLink::Truth()[0], std::log(TwoLink::Truth()[1])};
    const double tau[] = {kFrequency, kDecay};
    for (std::size_t j = 0; j < 2; ++j) {
      const ParameterScatter& p = h.parameters()[j];
      mean[j] += p.mean95.low < truth[j] && truth[j] < p.mean95.high;
      scatter[j] += p.scatter95.low < tau[j] && tau[j] < p.scatter95.high;
    }
    Stamps stamps;
    stamps.marks = {"elbow", "tip"};
    stamps.t.assign(2, {});
    for (double t = 0.1; t < recording.duration; t += 0.15) {
      stamps.t[0].push_back(t), stamps.t[1].push_back(t);
    }
    const NextTrial next = PredictNext(model, parameters, h, stamps, recording.sigma);
    const Prediction shown = model.Evaluate(Draw(rng), stamps);
    for (std::size_t m = 0; m < 2; ++m) {
      for (Eigen::Index i = 0; i < next.low[m].cols(); ++i) {
        for (Eigen::Index axis = 0; axis < 2; ++axis) {
          const double y = shown.marks[m].p(axis, i) + recording.sigma * rng.Normal();
          ++samples;
          inside += next.low[m](axis, i) < y && y < next.high[m](axis, i);
        }
      }
    }
    return true;
  }
};

}  // namespace unfurl::correlate
