#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/random_vector.h"
#include "correlate/design/planned_trial.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate {

// A record of the two-link arm and its fit.
struct Fitted {
  TwoLink model;
  Observations data;
  FitProblem problem;
  FitOptions options;
  FitResult fit;

  Fitted(const Trial& trial, std::uint64_t seed, const std::vector<std::string>& marks) {
    Rng rng(seed);
    data = Record(model, TwoLink::Truth(), marks, trial, rng);
    Solve();
  }
  void Solve() {
    problem.parameters = TwoLinkParameters();
    problem.trials.resize(1);
    problem.trials[0].model = &model;
    problem.trials[0].observations = &data;
    options.profile.wanted = false;
    options.workers = 1;
    fit = Fit(problem, options);
    ASSERT_TRUE(fit.Usable()) << fit.message;
  }
};

// Lines in which each of these marks is lit, on the record's clock.
inline PlannedContent ContentOf(const std::vector<std::string>& marks, const Trial& trial,
                                double line, int slots) {
  PlannedContent content;
  for (const std::string& name : marks) {
    PlannedMark mark;
    mark.name = name;
    int k = 0;
    for (double s = -trial.before; s <= trial.duration; s += line, ++k) {
      mark.t.push_back(s + trial.offset);
      mark.slot.push_back(k % slots);
    }
    content.marks.push_back(std::move(mark));
  }
  return content;
}

// What the choice comes to as a record: the model's own motion with noise.
inline Observations Recorded(const PlannedContent& content, const Choice& choice,
                             const Trial& trial, Rng& rng) {
  Observations out;
  out.frame = "rig";
  for (std::size_t m = 0; m < content.marks.size(); ++m) {
    if (choice.slots[m].empty()) continue;
    MarkSeries series;
    series.name = content.marks[m].name;
    for (std::size_t i = 0; i < content.marks[m].t.size(); ++i) {
      const int slot = content.marks[m].slot[i];
      if (!std::binary_search(choice.slots[m].begin(), choice.slots[m].end(), slot)) continue;
      series.t.push_back(content.marks[m].t[i]);
    }
    const auto n = static_cast<Eigen::Index>(series.size());
    series.p.resize(3, n);
    series.cov.resize(6, n);
    series.shared.setZero(3, 0);
    const double v = trial.sigma * trial.sigma;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = series.t[static_cast<std::size_t>(i)] - trial.offset;
      const Eigen::Vector3d y = TwoLink::Position(TwoLink::Truth(), series.name, std::max(0.0, t));
      series.p.col(i) = trial.X_WM * y + trial.sigma * NormalVector(&rng);
      series.cov.col(i) << v, 0.0, 0.0, v, 0.0, v;
    }
    out.marks.push_back(std::move(series));
  }
  return out;
}

}  // namespace unfurl::correlate
