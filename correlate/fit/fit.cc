#include "correlate/fit/fit.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "base/error.h"
#include "correlate/align/first_impact.h"
#include "correlate/fit/fit_run.h"
#include "correlate/fit/growing.h"
#include "correlate/fit/search.h"

namespace unfurl::correlate {

std::vector<double> FitResult::Theta() const {
  std::vector<double> out;
  for (const ParameterEstimate& e : parameters) out.push_back(e.value);
  return out;
}

namespace {

void CheckProblem(const FitProblem& problem) {
  if (problem.parameters.empty()) {
    throw Error("a study without parameters", "parameters", "name at least one");
  }
  for (const Parameter& p : problem.parameters) Check(p);
  if (problem.trials.empty()) {
    throw Error("a study without a trial", "trials", "name at least one");
  }
  for (const FitTrial& trial : problem.trials) {
    if (trial.rungs.size() != problem.trials.front().rungs.size()) {
      throw Error("its ladder has another number of rungs", "trial " + trial.name,
                  "give every trial the same rungs");
    }
    if (!trial.observations->has_sigma) {
      throw Error("the data carry no covariances", "tracks",
                  "fit to tracks; a run is compared by `correlate`");
    }
  }
}

// A search of more than the start, where none was ordered and the bounds allow one.
std::optional<FitOptions> Wider(const FitProblem& problem, const FitOptions& options) {
  constexpr int kPointsEach = 16;  // of a parameter: basins a sixteenth of its range wide
  constexpr int kStarts = 2;       // the best and, for what the first horizon hides, one more
  const SearchOptions& search = options.search;
  if (search.screened != SearchOptions::kAsNeeded || search.starts > 1) return {};
  for (const Parameter& p : problem.parameters) {
    if (!std::isfinite(p.low) || !std::isfinite(p.high)) return {};
  }
  FitOptions wider = options;
  wider.search.screened = kPointsEach * static_cast<int>(problem.parameters.size());
  wider.search.starts = kStarts;
  wider.stages_by_impacts = options.stages.empty();
  return wider;
}

// The same where the model moves between the samples by what they do not show: each minimum is
// narrow over the whole record, and wide over its first part, so that the horizon grows by itself
// where no impact says from where on.
FitOptions Closer(const FitProblem& problem, FitOptions wider) {
  constexpr int kStarts = 24;                    // there is a minimum at each alias
  constexpr double kFirst = 0.1, kGrowth = 1.6;  // of the record; as by impacts
  wider.search.starts = kStarts;
  wider.search.distinct = true;
  if (!wider.stages.empty() || std::isfinite(FirstImpact(*problem.trials.front().observations))) {
    return wider;
  }
  wider.stages_by_impacts = false;
  const Observations& o = *problem.trials.front().observations;
  // On the model's clock, as far as it is known: the record's begin is taken for its start if not.
  const double begin = o.placement.offset.Told() ? o.Start() - o.placement.offset.mean : 0.0;
  const double least = static_cast<double>(FewestOfHorizon(problem, wider)) /
                       static_cast<double>(std::max<std::size_t>(1, o.readings()));
  for (double part = std::max(kFirst, least); part * kGrowth < 1.0; part *= kGrowth) {
    wider.stages.push_back(begin + part * (o.End() - o.Start()));
  }
  std::erase_if(wider.stages, [](double end) { return !(end > 0.0); });
  return wider;
}

// Looks over the bounds, and goes over to what leads lower. False: nothing does. `hidden`: what
// leads nearly as low is weighed, too.
bool GoElsewhere(const FitProblem& problem, const FitOptions& wider, bool hidden,
                 std::unique_ptr<FitRun>* run) {
  auto other = std::make_unique<FitRun>(problem, wider);
  const bool led = other->Screen() && other->LeadStarts();
  const std::vector<std::vector<double>> ends =
      led && hidden ? other->Ends() : std::vector<std::vector<double>>{};
  const bool lower = led && other->LedLowerThan(**run);
  if (lower) {
    other->TakeOver(std::move(**run), Elsewhere::kFound);
    *run = std::move(other);
  } else {
    (*run)->TakeOver(std::move(*other), Elsewhere::kNothing);
  }
  (*run)->LookAtEnds(ends);
  return lower;
}

// Leads the start along a growing horizon, where it lies beside the whole record nowhere (`aligned`
// false) or led to what does not explain the data; goes over to what leads lower. `kept`: the
// options of what was gone over to.
bool GoAlong(const FitProblem& problem, const FitOptions& options, bool aligned,
             std::deque<FitOptions>* kept, std::unique_ptr<FitRun>* run) {
  constexpr int kMostLed = 2;  // where the start was led already: each costs as much as that did
  int led_so_far = 0;
  for (const FitOptions& grown : GrowingHorizons(problem, options)) {
    if (aligned && led_so_far == kMostLed) break;
    kept->push_back(grown);
    auto other = std::make_unique<FitRun>(problem, kept->back());
    const bool led = other->Screen() && other->StartExplains() && other->LeadStarts();
    led_so_far += led ? 1 : 0;
    if (led && (aligned ? other->LedLowerThan(**run) : other->LiesBesideRecord())) {
      other->TakeOver(std::move(**run), Elsewhere::kNotLooked);
      *run = std::move(other);
      return true;
    }
    (*run)->TakeOver(std::move(*other), Elsewhere::kNotLooked);
  }
  return false;
}

// Leads the start from other places in time than the one that an alignment found best, where that
// led to what does not explain the data (`aligned`), or there was none; goes over to what leads
// lower, and ends where the data are explained.
bool GoFromPlaces(const FitProblem& problem, const FitOptions& options, bool aligned,
                  std::deque<FitOptions>* kept, std::unique_ptr<FitRun>* run) {
  bool moved = false;
  if (options.search.screened == 0) return moved;  // a search was ordered off
  for (FitOptions& way : (*run)->OtherBeginnings(options)) {
    kept->push_back(std::move(way));
    auto other = std::make_unique<FitRun>(problem, kept->back());
    const bool led = other->Screen() && other->StartExplains() && other->LeadStarts();
    const bool better =
        led && (aligned || moved ? other->ExplainsBetterThan(**run) : other->LiesBesideRecord());
    if (!better) {
      (*run)->TakeOver(std::move(*other), Elsewhere::kNotLooked);
      continue;
    }
    other->TakeOver(std::move(**run), Elsewhere::kNotLooked);
    *run = std::move(other);
    moved = true;
    if ((*run)->WayExplains()) break;
  }
  return moved;
}

// Where the start lies beside the record nowhere, and no part of it leads: from points over the
// bounds that do.
bool GoFromBounds(const FitProblem& problem, const FitOptions& options,
                  std::deque<FitOptions>* kept, std::unique_ptr<FitRun>* run) {
  const std::optional<FitOptions> wider = Wider(problem, options);
  if (!wider) return false;
  kept->push_back(*wider);  // the run refers to it
  auto other = std::make_unique<FitRun>(problem, kept->back());
  const bool led = other->Screen() && other->LeadStarts() && other->LiesBesideRecord();
  if (led) {
    other->TakeOver(std::move(**run), Elsewhere::kFound);
    *run = std::move(other);
  } else {
    (*run)->TakeOver(std::move(*other), Elsewhere::kNotLooked);
  }
  return led;
}

// From the start to a first minimum; false: there is none.
bool Begin(const FitProblem& problem, const FitOptions& options, std::deque<FitOptions>* kept,
           std::unique_ptr<FitRun>* run) {
  const bool aligned = (*run)->Screen();
  if (aligned) {
    if (!(*run)->LeadStarts() || !(*run)->Solve()) return false;
    if (!(*run)->Unexplained()) return true;
    if (GoAlong(problem, options, true, kept, run) && !(*run)->Solve()) return false;
  } else if (!(*run)->NotAligned()) {
    return false;
  } else if (GoAlong(problem, options, false, kept, run)) {
    if (!(*run)->Solve()) return false;
  } else {
    return (GoFromPlaces(problem, options, false, kept, run) ||
            GoFromBounds(problem, options, kept, run)) &&
           (*run)->Solve();
  }
  return !(*run)->Unexplained() || !GoFromPlaces(problem, options, true, kept, run) ||
         (*run)->Solve();
}

void Require(bool good, const char* option, const char* remedy) {
  if (!good) throw Error("is out of its range", std::string("FitOptions.") + option, remedy);
}

}  // namespace

void FitOptions::Check() const {
  Require(std::is_sorted(stages.begin(), stages.end()), "stages", "let the ends rise");
  Require(stages.empty() || stages.front() > 0.0, "stages", "give positive times");
  Require(search.screened >= SearchOptions::kAsNeeded, "search.screened",
          "give 0 or more points, or -1: as needed");
  Require(search.starts >= 1, "search.starts", "carry on at least one start");
  Require(max_iterations >= 1, "max_iterations", "allow at least one");
  Require(step_tolerance > 0.0 && step_tolerance < 1.0, "step_tolerance", "give a part of 1");
  Require(difference_sigma > 0.0, "difference_sigma", "give a positive part of the sigma");
  Require(clock_sigma > 0.0 && clock_sigma < 1.0, "clock_sigma", "give a part of 1");
  Require(noise_factor >= 1.0, "noise_factor", "give 1 or more");
  Require(error_sections >= 1, "error_sections", "give at least one");
  Require(std::all_of(profile.levels.begin(), profile.levels.end(), [](double l) { return l > 0; }),
          "profile.levels", "give positive numbers of standard errors");
  Require(profile.max_evaluations >= 1, "profile.max_evaluations", "allow at least one");
}

FitResult Fit(const FitProblem& problem, const FitOptions& options) {
  CheckProblem(problem);
  options.Check();
  std::deque<FitOptions> kept;  // runs refer to them
  auto run = std::make_unique<FitRun>(problem, options);
  if (!Begin(problem, options, &kept, &run)) return run->Finish();
  // Residuals far above the data's sigmas: the model lacks something, or this is a wrong minimum.
  const std::optional<FitOptions> wider = Wider(problem, options);
  std::optional<FitOptions> closer;
  bool looked = wider && run->Unexplained();
  if (looked && GoElsewhere(problem, *wider, false, &run) && !run->Solve()) return run->Finish();
  for (;;) {
    if (!run->Estimate(wider.has_value())) return run->Finish();
    bool moved = run->GoToBetterPoint();
    // Where no sigma is stated residuals are as large as the sigma whatever minimum this is: that
    // it is a wrong one shows only in that they are no noise.
    if (!moved && wider && !closer && (run->HidesMotion() || run->WantsSearch())) {
      looked = true;
      closer = Closer(problem, *wider);
      moved = GoElsewhere(problem, *closer, true, &run);
    } else if (!moved && wider && !looked && run->UnexplainedByNoiseFound()) {
      looked = true;
      moved = GoElsewhere(problem, *wider, false, &run);
    }
    if (!moved) break;
    if (!run->Solve()) return run->Finish();
  }
  run->WeighOtherClocks();
  run->JudgeParameters();
  run->JudgeEnd();
  return run->Finish();
}

const char* Name(FitStatus status) {
  switch (status) {
    case FitStatus::kConverged:
      return "converged";
    case FitStatus::kNotAligned:
      return "not aligned";
    case FitStatus::kModelFailed:
      return "model failed";
    case FitStatus::kNotConverged:
      return "not converged";
  }
  return "";
}

}  // namespace unfurl::correlate
