#include "correlate/fit/screening.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"
#include "base/random.h"
#include "base/worker_pool.h"
#include "correlate/align/first_impact.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

std::vector<std::string> MarkNames(const Observations& o) {
  std::vector<std::string> names;
  for (const MarkSeries& m : o.marks) names.push_back(m.name);
  return names;
}

}  // namespace

std::vector<std::vector<double>> LatinHypercube(const std::vector<Parameter>& parameters,
                                                std::size_t count, std::uint64_t seed) {
  std::vector<std::vector<double>> points(count, std::vector<double>(parameters.size()));
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    const Parameter& p = parameters[j];
    if (!std::isfinite(p.low) || !std::isfinite(p.high)) {
      throw Error("several starts need finite bounds", "parameter." + p.name,
                  "give bounds = [low, high], or one start");
    }
    Rng rng = Rng(seed).Stream("latin hypercube", j);
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    for (std::size_t i = count; i > 1; --i) {
      std::swap(order[i - 1], order[static_cast<std::size_t>(rng.Integer(i))]);
    }
    const double low = ToInternal(p, SearchLow(p)), high = ToInternal(p, p.high);
    for (std::size_t i = 0; i < count; ++i) {
      const double part =
          (static_cast<double>(order[i]) + rng.Uniform()) / static_cast<double>(count);
      points[i][j] = FromInternal(p, low + part * (high - low));
    }
  }
  return points;
}

Stamps AlignmentGrid(const Observations& o, const FitOptions& options) {
  // Late motion at wrong parameters aligns anything with anything: where there are stages, the
  // first one's horizon is what is aligned.
  double horizon = o.End() - o.Start();
  // What shows no place may begin long after the release: as long as it lasts.
  if (o.marks.empty()) horizon *= 2.0;
  if (o.marks.empty() && o.placement.offset.Told()) {
    horizon = o.End() - o.placement.offset.mean + o.placement.offset.sigma;
  }
  if (!options.stages.empty()) {
    horizon = std::min(horizon, *std::min_element(options.stages.begin(), options.stages.end()));
  }
  if (options.stages_by_impacts && std::isfinite(FirstImpact(o))) {
    horizon = std::min(horizon, FirstImpact(o) - o.Start());
  }
  // Positions and velocities on half the data's own step carry any motion that the data show;
  // quantities are asked for as finely as their channels want them. At the least 200 points, so
  // that a model's ten periods over the horizon are smooth between them however sparse the data;
  // beyond a hundred thousand a coarser grid aligns as well.
  constexpr double kFewest = 200.0, kMost = 1e5;
  const double least = o.marks.empty() ? o.ShortestStep() : MedianStep(o.marks.front().t);
  const double step = std::clamp(0.5 * least, horizon / kMost, horizon / kFewest);
  Stamps grid = EvenStamps(MarkNames(o), 0.0, horizon, step);
  // One point before the start: what a held model has there stands for all of before.
  for (const auto& kind : o.others) kind->AskOver(-step, horizon, &grid);
  return grid;
}

std::vector<Candidate> Screen(const FitProblem& problem, const FitOptions& options,
                              const std::vector<std::vector<double>>& points, Evaluator& evaluator,
                              const std::vector<Evaluator::Request>& beside,
                              const std::vector<Stamps>& beside_stamps,
                              std::vector<Evaluator::Answer>* beside_answers) {
  std::vector<Stamps> grid;
  for (const FitTrial& trial : problem.trials) {
    grid.push_back(AlignmentGrid(*trial.observations, options));
  }
  std::vector<Evaluator::Request> requests = beside;
  std::vector<Stamps> stamps = beside_stamps;
  for (const std::vector<double>& theta : points) {
    for (std::size_t t = 0; t < problem.trials.size(); ++t) {
      requests.push_back({t, theta, "alignment"});
      stamps.push_back(grid[t]);
    }
  }
  std::vector<Evaluator::Answer> answers = evaluator.EvaluateAt(requests, stamps);
  const auto shift = static_cast<std::ptrdiff_t>(beside.size());
  if (beside_answers != nullptr) {
    beside_answers->assign(answers.begin(), answers.begin() + shift);
  }
  answers.erase(answers.begin(), answers.begin() + shift);

  AlignOptions how = options.align;
  how.part = !options.stages.empty() || options.stages_by_impacts;
  std::vector<Candidate> out(points.size());
  ParallelFor(points.size(), options.workers, [&](std::size_t i) {
    Candidate& c = out[i];
    AlignOptions align = how;
    c.theta = points[i];
    c.usable = true;
    double squares = 0.0, count = 0.0;
    for (std::size_t t = 0; t < problem.trials.size() && c.usable; ++t) {
      const Prediction& prediction = *answers[i * problem.trials.size() + t];
      if (prediction.status != ModelStatus::kGood) {
        c.usable = false;
        c.failed = true;
        c.message = "the model failed at the start parameters: " + prediction.message;
        continue;
      }
      const SampledModel sampled(grid[t], prediction);
      if (!options.search.places.empty()) align.at = {options.search.places[t]};
      c.alignment.push_back(Align(*problem.trials[t].observations, sampled, align));
      const Alignment& a = c.alignment.back();
      // An alignment that did not settle is start enough; one of unrelated records is not.
      c.usable = a.status == AlignStatus::kGood || a.status == AlignStatus::kNotConverged;
      if (!c.usable) c.message = a.message;
      squares += a.fit.residual.squaredNorm();
      count += static_cast<double>(a.fit.data_rows);
    }
    c.misfit = count > 0.0 ? squares / count : 0.0;
  });
  return out;
}

}  // namespace unfurl::correlate
