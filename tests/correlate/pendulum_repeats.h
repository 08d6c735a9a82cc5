#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "base/worker_pool.h"
#include "tests/correlate/pendulum.h"

namespace unfurl::correlate {

struct PendulumCount {
  int found = 0;                  // global minima
  int covered[4] = {0, 0, 0, 0};  // truth within 1.96 standard errors
  double most_evaluations = 0.0;
  std::string misses;
};

// Half the sum of squares of these data with the model at these values, frame and offset at their
// best.
inline double CostAt(const Model& model, const std::vector<double>& theta, const Observations& data,
                     double offset) {
  const Prediction prediction = model.Evaluate(theta, data.StampsAt(offset));
  const Registration start = StartingFrame(data, prediction, offset);
  return 0.5 * FitRegistration(data, prediction, offset, start).SumOfSquares();
}

// Fits with several starts to planted truths. The minimum is the global one when it lies no higher
// than the truth does: four fitted parameters take 2 off half the sum of squares on average, so 5
// above the truth is another minimum.
inline PendulumCount RepeatPendulum(int trials, std::uint64_t first) {
  constexpr double kAbove = 5.0;
  std::vector<FitResult> fits(static_cast<std::size_t>(trials));
  std::vector<std::vector<double>> truths(fits.size());
  std::vector<double> planted(fits.size());
  ParallelFor(fits.size(), 0, [&](std::size_t i) {
    Rng rng = Rng(first + i).Stream("pendulum");
    truths[i] = Pendulum::Truth(rng);
    std::vector<double> start;
    for (const Parameter& p : Pendulum::Parameters()) start.push_back(p.start);
    const study::SceneModel model(Pendulum::Binding(), start);
    const study::SceneModel tighter(Pendulum::Binding(0.1 * Pendulum::kTolerance), start);
    const Observations data =
        Record(model, truths[i], Pendulum::Marks(), Pendulum::Recording(), rng);
    planted[i] = CostAt(model, truths[i], data, Pendulum::Recording().offset);
    FitProblem problem;
    problem.parameters = Pendulum::Parameters();
    problem.trials.resize(1);
    problem.trials[0].observations = &data;
    problem.trials[0].model = &model;
    problem.trials[0].tighter = &tighter;
    FitOptions options = Pendulum::Options();
    options.workers = 1;
    fits[i] = Fit(problem, options);
  });
  PendulumCount count;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    const FitResult& fit = fits[i];
    const double cost = fit.starts.empty() ? -1.0 : fit.starts.front().cost;
    const bool found = fit.Usable() && cost >= 0.0 && cost < planted[i] + kAbove;
    count.found += found ? 1 : 0;
    count.most_evaluations =
        std::max(count.most_evaluations, static_cast<double>(fit.evaluations.size()));
    if (!found) {
      count.misses += fmt::format("seed {}: {}, {}, {:.1f} against {:.1f} at the truth\n",
                                  first + i, Name(fit.status), fit.message, cost, planted[i]);
    }
    for (std::size_t j = 0; j < 4 && found; ++j) {
      const ParameterEstimate& e = fit.parameters[j];
      count.covered[j] += std::abs(e.value - truths[i][j]) <= 1.959964 * e.sigma ? 1 : 0;
    }
  }
  return count;
}

}  // namespace unfurl::correlate
