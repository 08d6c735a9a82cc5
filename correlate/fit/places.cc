#include "correlate/fit/places.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "correlate/align/align.h"
#include "correlate/fit/growing.h"
#include "correlate/fit/screening.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

namespace {

struct Place {
  double offset = 0.0;  // [s]
  double r2 = 0.0;      // of the first horizon [-]
};

// One trial and its model at the start's values.
struct Beside {
  const Observations* record;
  const SampledModel* whole;
  bool sought;  // its offset

  double Begin() const {
    const Prior& known = record->placement.offset;
    return known.Told() ? known.mean : record->Start();
  }
};

// Up to `first` [s] after the release, or after the record's begin if that is later.
Observations FirstOf(const Observations& record, double offset, double first) {
  const double end = std::max(record.Start(), offset) + first;
  return Cut(record, {-std::numeric_limits<double>::infinity(), end});
}

// The best places over a first horizon; `early`: the model over that alone.
std::vector<Place> PlacesOf(const Beside& trial, const SampledModel& early, double first,
                            const AlignOptions& asked) {
  const Observations& o = *trial.record;
  const Prior& known = o.placement.offset;
  AlignOptions options = asked;
  options.part = true;
  const double stands = known.Told() ? known.mean : 0.0;
  std::vector<double> offsets = {stands};
  if (trial.sought) {
    for (const double x : OffsetsAlike(FirstOf(o, trial.Begin(), first), *trial.whole, options)) {
      offsets.push_back(x);
    }
    for (const double x : OffsetsAlike(o, early, options)) offsets.push_back(x);
  }
  std::vector<Place> out;
  bool first_stands = false;
  for (const double& offset : offsets) {
    options.at = {offset};
    const Alignment a = Align(FirstOf(o, offset, first), *trial.whole, options);
    // Nearer than half a step is the same place.
    const double near = 0.5 * o.ShortestStep();
    const bool taken = std::any_of(out.begin(), out.end(), [&](const Place& p) {
      return std::abs(p.offset - a.at.offset) <= near;
    });
    const bool usable = a.Usable() || a.status == AlignStatus::kNotConverged;
    if (!usable || taken || a.r2 < options.min_r2_of_one) continue;
    first_stands = first_stands || &offset == &offsets.front();
    out.push_back({a.at.offset, a.r2});
  }
  std::stable_sort(out.begin() + (first_stands ? 1 : 0), out.end(),
                   [](const Place& a, const Place& b) { return a.r2 > b.r2; });
  return out;
}

// Of each trial its first, second.. place, as many as the trial that has most.
void AddWays(const std::vector<Beside>& trials, const std::vector<std::vector<Place>>& places,
             const FitOptions& grown, std::vector<FitOptions>* out) {
  constexpr std::size_t kMost = 4;  // of a horizon: the clocks as they stand, and three found
  std::size_t most = 0;
  for (const auto& p : places) {
    if (p.empty()) return;
    most = std::max(most, p.size());
  }
  for (std::size_t k = 0; k < std::min(most, kMost); ++k) {
    FitOptions way = grown;
    double late = 0.0;  // after the release the records begin [s]
    for (std::size_t t = 0; t < trials.size(); ++t) {
      const double offset = places[t][std::min(k, places[t].size() - 1)].offset;
      way.search.places.push_back(offset);
      late = std::max(late, trials[t].Begin() - offset);
    }
    for (double& end : way.stages) end += late;
    const bool led = std::any_of(out->begin(), out->end(), [&](const FitOptions& before) {
      return before.search.places == way.search.places;
    });
    if (!led) out->push_back(std::move(way));
  }
}

}  // namespace

std::vector<FitOptions> OtherBeginnings(const FitProblem& problem, const FitOptions& options,
                                        Evaluator& evaluator) {
  std::vector<FitOptions> out;
  const std::vector<FitOptions> horizons = GrowingHorizons(problem, options, true);
  const auto sought = [&](const FitTrial& t) {
    return WithPlacement(options.align.registration, *t.observations).fit_offset;
  };
  if (horizons.empty() || std::none_of(problem.trials.begin(), problem.trials.end(), sought)) {
    return out;
  }
  std::vector<double> start;
  for (const Parameter& p : problem.parameters) start.push_back(p.start);
  const std::size_t n = problem.trials.size();
  std::vector<Evaluator::Request> requests;
  std::vector<Stamps> stamps;
  for (std::size_t h = 0; h <= horizons.size(); ++h) {  // the last: over all
    for (std::size_t t = 0; t < n; ++t) {
      requests.push_back({t, start, "other beginnings"});
      stamps.push_back(AlignmentGrid(*problem.trials[t].observations,
                                     h < horizons.size() ? horizons[h] : options));
    }
  }
  const std::vector<Evaluator::Answer> answers = evaluator.EvaluateAt(requests, stamps);
  std::vector<SampledModel> models;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    if (answers[i]->status != ModelStatus::kGood) return out;
    models.emplace_back(stamps[i], *answers[i]);
  }
  std::vector<Beside> trials;
  for (std::size_t t = 0; t < n; ++t) {
    trials.push_back({problem.trials[t].observations, &models[horizons.size() * n + t],
                      sought(problem.trials[t])});
  }
  for (std::size_t h = 0; h < horizons.size(); ++h) {
    std::vector<std::vector<Place>> places(n);
    for (std::size_t t = 0; t < n; ++t) {
      const std::vector<double>& ends = horizons[h].stages;
      const double first = ends.empty() ? std::numeric_limits<double>::infinity() : ends.front();
      places[t] = PlacesOf(trials[t], models[h * n + t], first, options.align);
    }
    AddWays(trials, places, horizons[h], &out);
  }
  return out;
}

}  // namespace unfurl::correlate
