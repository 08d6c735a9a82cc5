#include "correlate/fit/fit_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/worker_pool.h"
#include "correlate/fit/fit_covariance.h"
#include "correlate/fit/fit_estimate.h"
#include "correlate/fit/ladder_error.h"
#include "correlate/fit/other_clocks.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/start_choice.h"
#include "correlate/fit/verdict.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// Of deviance, beside what correlated residuals add to its scale: a point of a profile that is
// lower by less is the same minimum, known to less than a standard error.
constexpr double kBetter = 1.0;

// Returns to a lower point of a profile. Each lowers the cost by at least half of kBetter, so the
// returns end; a cost that is still not at its minimum after these is too rough for the search that
// was asked for, and the fit says so.
constexpr int kMostReturns = 3;

// How far the model's marks at the study's start move with its solver's tolerance, by trial.
struct NoiseProbe {
  std::vector<Evaluator::Request> requests;  // tighter and main, in turn
  std::vector<Stamps> stamps;

  NoiseProbe(const FitProblem& problem, const std::vector<double>& theta) {
    for (std::size_t t = 0; t < problem.trials.size(); ++t) {
      if (problem.trials[t].tighter == nullptr) continue;
      const Observations& o = *problem.trials[t].observations;
      for (Fidelity fidelity : {Fidelity::kTighter, Fidelity::kMain}) {
        requests.push_back({t, theta, "noise", fidelity});
        stamps.push_back(o.StampsAt(o.Start()));
      }
    }
  }

  // In metres of the marks, and in sigmas of the data.
  void Take(const FitProblem& problem, const std::vector<Evaluator::Answer>& found,
            std::vector<double>* metres, std::vector<double>* sigmas) const {
    metres->assign(problem.trials.size(), 0.0);
    sigmas->assign(problem.trials.size(), 0.0);
    for (std::size_t i = 0; i + 1 < found.size(); i += 2) {
      const Prediction &a = *found[i], &b = *found[i + 1];
      if (a.status != ModelStatus::kGood || b.status != ModelStatus::kGood) continue;
      const std::size_t t = requests[i].trial;
      const Observations& o = *problem.trials[t].observations;
      (*metres)[t] = RmsDifference(a, b);
      (*sigmas)[t] = RmsInSigmas(o, o.Start(), a, b);
    }
  }
};

}  // namespace

FitRun::Budget FitRun::BudgetOf(const FitProblem& problem, const FitOptions& options) {
  // A stage takes about three rounds of a trial point and its differences.
  const std::size_t p = problem.parameters.size(), trials = problem.trials.size();
  const std::size_t starts = static_cast<std::size_t>(std::max(1, options.search.starts));
  Budget b;
  b.screening = trials * (static_cast<std::size_t>(std::max(0, options.search.screened)) + 3);
  b.leading = starts * trials * (3 * (1 + p) + 1) * (options.stages.size() + 1);
  b.sharpening = trials * (2 * (1 + 2 * p) + 1);
  if (options.profile.wanted) b.profiles = trials * 2 * p * options.profile.levels.size() * 3;
  return b;
}

FitRun::FitRun(const FitProblem& problem, const FitOptions& options)
    : problem_(problem),
      options_(options),
      trials_(problem.trials.size()),
      far_(FarOf(problem, options.robust)),
      way_(Way()),
      local_(options.where == nullptr ? LocalWorkers(options.workers) : nullptr),
      workers_(options.where != nullptr ? *options.where : *local_, options.progress),
      budget_(BudgetOf(problem, options)),
      ladder_(problem, options),
      weighed_(trials_),
      data_(trials_, nullptr),
      whitening_(trials_),
      whiteners_(trials_, nullptr) {
  result_.parameters.resize(problem.parameters.size());
  result_.trials.resize(trials_);
  for (std::size_t t = 0; t < trials_; ++t) result_.trials[t].name = problem.trials[t].name;
}

std::vector<std::vector<FarSample>> FitRun::FarOf(const FitProblem& problem, bool robust) {
  std::vector<std::vector<FarSample>> far(problem.trials.size());
  for (std::size_t t = 0; robust && t < far.size(); ++t) {
    far[t] = FindFarSamples(*problem.trials[t].observations);
  }
  return far;
}

FitProblem FitRun::Way() {
  FitProblem way = problem_;
  widened_.resize(trials_);
  for (std::size_t t = 0; t < trials_; ++t) {
    const Observations& all = *problem_.trials[t].observations;
    far_readings_.push_back(options_.robust ? FindFarReadings(all)
                                            : std::vector<std::vector<std::size_t>>());
    if (!AnyFar(t)) continue;
    widened_[t] = WithoutFar(all, t);
    way.trials[t].observations = &widened_[t];
  }
  return way;
}

bool FitRun::AnyFar(std::size_t trial) const {
  const auto& readings = far_readings_[trial];
  return !far_[trial].empty() || std::any_of(readings.begin(), readings.end(),
                                             [](const auto& far) { return !far.empty(); });
}

Observations FitRun::WithoutFar(const Observations& all, std::size_t trial) const {
  return Aside(Widened(all, far_[trial]), far_readings_[trial]);
}

bool FitRun::Screen() {
  workers_.Phase("screening",
                 budget_.screening + budget_.leading + budget_.sharpening + budget_.profiles);
  Evaluator evaluator(problem_, workers_);
  const std::vector<std::vector<double>> points = PointsToScreen(problem_, options_.search);
  const NoiseProbe probe(problem_, points[0]);
  std::vector<Evaluator::Answer> found;
  candidates_ =
      correlate::Screen(way_, options_, points, evaluator, probe.requests, probe.stamps, &found);
  probe.Take(problem_, found, &noise_, &noise_sigmas_);
  result_.evaluations = evaluator.records();
  for (std::size_t i : ChooseCandidates(candidates_, options_.search.starts)) {
    AddRunner(candidates_[i]);
  }
  if (!runners_.empty()) return true;
  const Candidate& own = candidates_[0];
  result_.status = own.failed ? FitStatus::kModelFailed : FitStatus::kNotAligned;
  result_.message = own.message;
  for (std::size_t t = 0; t < own.alignment.size(); ++t) {
    result_.trials[t].alignment = own.alignment[t];
  }
  return false;
}

bool FitRun::StartExplains() const {
  const Candidate& own = candidates_.front();
  return own.usable && std::all_of(own.alignment.begin(), own.alignment.end(), [&](const auto& a) {
           return a.r2 >= options_.align.min_r2_of_one;
         });
}

void FitRun::AddRunner(const Candidate& from) {
  const auto start = static_cast<int>(runners_.size() + retired_.size());
  runners_.push_back(std::make_unique<StageRunner>(way_, options_, from, workers_, start));
  runners_.back()->SetModelNoise(noise_sigmas_);
  runners_.back()->on_best = [this](double cost, const std::vector<double>& theta) {
    workers_.Best(cost, theta);
  };
}

// A thread per start; how many evaluations run at a time is the workers' matter.
void FitRun::LeadAll(std::size_t from_stage, std::size_t to_stage) {
  failed_.resize(runners_.size(), 0);
  ParallelFor(runners_.size(), runners_.size(), [&](std::size_t s) {
    const std::size_t end = std::min(to_stage, runners_[s]->stages());
    for (std::size_t i = from_stage; i < end && !failed_[s]; ++i) {
      failed_[s] = runners_[s]->Lead(i) ? 0 : 1;
    }
  });
}

void FitRun::ScatterWhatIsOpen() {
  StageRunner* first = nullptr;
  for (std::size_t s = 0; s < runners_.size(); ++s) {
    if (failed_[s] || runners_[s]->stages() < 2) continue;
    if (first == nullptr || runners_[s]->misfit() < first->misfit()) first = runners_[s].get();
  }
  if (first == nullptr || options_.search.screened <= 0) return;
  std::vector<std::vector<double>> points = first->ScatterOpen(
      LatinHypercube(problem_.parameters, static_cast<std::size_t>(options_.search.screened),
                     options_.search.seed + 1));
  if (points.empty()) return;
  points.push_back(Values(problem_.parameters, first->u().data()));
  const std::vector<double> costs = first->CostsAt(points, 1);
  const auto wanted = static_cast<std::size_t>(std::max(1, options_.search.starts));
  for (auto& runner : runners_) retired_.push_back(std::move(runner));
  runners_.clear();
  failed_.clear();
  for (std::size_t i : SeparatePoints(problem_.parameters, points, costs, wanted)) {
    AddRunner(first->candidate());
    runners_.back()->MoveTo(points[i], *first);
  }
}

bool FitRun::LeadStarts() {
  workers_.Phase(runners_.size() > 1 ? fmt::format("{} starts", runners_.size()) : "stages",
                 budget_.leading + budget_.sharpening + budget_.profiles);
  if (runners_.size() == 1 && runners_[0]->stages() == 1) runners_[0]->LeadAlone();
  LeadAll(0, 1);
  if (options_.search.distinct) DropTwins();
  if (!options_.search.distinct || runners_.size() == 1) ScatterWhatIsOpen();
  if (runners_.size() == 1) runners_[0]->LeadAlone();
  LeadAll(1, std::numeric_limits<std::size_t>::max());
  for (const auto& runner : runners_) {
    if (runner->result().cost < 0.0) continue;
    if (best_ == nullptr || runner->result().cost < best_->result().cost) best_ = runner.get();
  }
  if (best_ == nullptr) {
    result_.status = FitStatus::kModelFailed;
    result_.message = (runners_.empty() ? retired_ : runners_).front()->message();
    return false;
  }
  LookAtOtherClocks();
  for (std::size_t t = 0; t < trials_; ++t) {
    result_.trials[t].alignment = best_->candidate().alignment[t];
  }
  return true;
}

bool FitRun::Unexplained() const {
  double squares = 0.0, count = 0.0;
  for (const RegistrationFit& r : best_->point().registration) {
    squares += r.SumOfSquares();
    count += static_cast<double>(r.data_rows);
  }
  return squares > kNotNoise * count;
}

bool FitRun::UnexplainedByNoiseFound() const {
  for (std::size_t t = 0; t < trials_; ++t) {
    const GoodnessOfFit& goodness = result_.trials[t].goodness;
    if (goodness.outcome != Explained::kNo) continue;
    if (goodness.p_covariances() < kGoodnessLevel) return true;
    for (const RowSeries& s : RowLayout(*problem_.trials[t].observations).series) {
      if (!s.has_sigma) return true;
    }
  }
  return false;
}

// Of the whole record on the way, at its minimum: a lone start stops before that.
double FitRun::CostOfWay() {
  if (!best_->alone()) return best_->result().cost;
  if (way_cost_) return *way_cost_;
  StageRunner there(way_, options_, best_->candidate(), workers_, 0);
  there.SetModelNoise(noise_sigmas_);
  there.MoveTo(Values(problem_.parameters, best_->u().data()), *best_);
  const bool good = there.Lead(there.stages() - 1);
  const auto& records = there.evaluator().records();
  result_.evaluations.insert(result_.evaluations.end(), records.begin(), records.end());
  way_cost_ = good ? there.result().cost : best_->result().cost;
  return *way_cost_;
}

bool FitRun::LedLowerThan(FitRun& other) const {
  return best_ != nullptr && best_->result().cost < other.CostOfWay() - kBetter;
}

void FitRun::TakeOver(FitRun&& other, Elsewhere found) {
  FitResult tried = other.Finish();
  result_.evaluations.insert(result_.evaluations.begin(), tried.evaluations.begin(),
                             tried.evaluations.end());
  result_.elsewhere = found;
}

bool FitRun::Estimate(bool searched) {
  std::vector<Evaluator::Request> beside = RungsWanted(problem_, ladder_, *best_);
  const auto rivals = RivalRequests(problem_, Values(problem_.parameters, best_->u().data()));
  beside.insert(beside.end(), rivals.begin(), rivals.end());
  if (!FillEstimate(problem_, *best_, std::move(beside), &result_)) return false;
  FillRivals(problem_, *best_, &result_);
  if (ladder_.wanted()) FillWhatIsLeft(problem_, ladder_, *best_, &result_);
  for (std::size_t t = 0; t < trials_; ++t) result_.trials[t].kinds = weighed_[t].others;
  Eigen::MatrixXd doubt;
  WaysOfError ways;
  FillCovariance(problem_, data_, whiteners_, options_, &result_, &doubt);
  if (ladder_.wanted() && result_.status == FitStatus::kConverged) {
    ways = FollowError(problem_, ladder_, *best_, result_);
    result_.ladder.followed = ways.rounds;
    if (ways.first.size() + ways.bend.size() > 0) {
      FillCovariance(problem_, data_, whiteners_, options_, &result_, &doubt, ways);
    }
  }
  LookBetweenSamples();
  const bool on_hidden = RestsOnWhatHides(searched, &doubt);
  if (on_hidden) FillCovariance(problem_, data_, whiteners_, options_, &result_, &doubt, ways);
  // The data's part then adds at most 0.5% to a standard error (sqrt(1 + 1/100) = 1.005), so that
  // its profile would change nothing.
  constexpr double kRules = 10.0;
  result_.ladder.rules =
      ladder_.wanted() &&
      std::all_of(result_.parameters.begin(), result_.parameters.end(),
                  [](const ParameterEstimate& e) { return e.sigma_model > kRules * e.sigma_data; });
  if (options_.profile.wanted && !result_.ladder.rules && !on_hidden) {
    workers_.Phase("profiles", budget_.profiles);
    FillProfiles(problem_, best_->reduced(), best_->u(), best_->point(), options_, noise_sigmas_,
                 &result_);
  }
  return true;
}

// With a ladder the values are known no better than its finest rung: what is lower within the
// tolerance of that is its roughness.
bool FitRun::FarFrom(const std::vector<double>& theta) const {
  if (!ladder_.wanted()) return true;
  for (std::size_t j = 0; j < theta.size(); ++j) {
    const ParameterEstimate& e = result_.parameters[j];
    if (std::abs(theta[j] - e.value) > options_.step_tolerance * e.sigma) return true;
  }
  return false;
}

bool FitRun::GoToBetterPoint() {
  const ProfilePoint* lowest = nullptr;
  double dispersion = 1.0;
  for (const ParameterEstimate& e : result_.parameters) {
    for (const ProfilePoint& point : e.profile.points) {
      if (lowest != nullptr && point.deviance >= lowest->deviance) continue;
      lowest = &point;
      dispersion = e.profile.dispersion;
    }
  }
  result_.returns = returns_;
  result_.profile_below = lowest != nullptr ? std::max(0.0, -lowest->deviance) : 0.0;
  if (lowest == nullptr || result_.profile_below <= kBetter * dispersion ||
      !FarFrom(lowest->theta)) {
    return false;
  }
  if (returns_ < kMostReturns) {
    ++returns_;
    best_->Restart(lowest->theta);
    return true;
  }
  // A point outside of its own 95% region is no estimate.
  if (result_.profile_below > kDeviance95 * dispersion) {
    result_.status = FitStatus::kNotConverged;
    result_.message = fmt::format(
        "after {} returns a profile still holds a point whose deviance is lower by {:.2g}; screen "
        "more points and carry on more starts (solver.screened, solver.starts)",
        returns_, result_.profile_below);
  }
  return false;
}

void FitRun::JudgeParameters() {
  Judge(problem_, best_->reduced(), best_->point(), &result_);
  OpenByOtherClocks(problem_, &result_);
  OpenWhatIsHidden();
}

void FitRun::CountRuns() {
  result_.ladder.runs.assign(ladder_.wanted() ? ladder_.top() + 1 : 0, 0);
  for (const EvaluationRecord& e : result_.evaluations) {
    for (std::size_t rung = 0; rung < result_.ladder.runs.size(); ++rung) {
      result_.ladder.runs[rung] += e.fidelity == FidelityOfRung(rung) ? 1 : 0;
    }
  }
}

FitResult FitRun::Finish() {
  for (const auto* group : {&retired_, &runners_, &other_clocks_}) {
    for (const auto& runner : *group) {
      const auto& records = runner->evaluator().records();
      result_.evaluations.insert(result_.evaluations.end(), records.begin(), records.end());
    }
  }
  for (const auto& runner : runners_) {
    result_.starts.push_back(runner->result());
    if (runner.get() == best_) result_.stages = runner->result().stages;
  }
  if (best_ == nullptr && !runners_.empty()) result_.stages = runners_.front()->result().stages;
  CountRuns();
  SortByCost(&result_.starts);
  return std::move(result_);
}

}  // namespace unfurl::correlate
