#include "correlate/fit/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <numeric>

#include "base/error.h"
#include "base/worker_pool.h"
#include "correlate/fit/fit_covariance.h"
#include "correlate/fit/fit_estimate.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/search.h"
#include "correlate/fit/verdict.h"

namespace unfurl::correlate {

namespace {

// Counts answers and tells what is going on.
class Watched : public Workers {
 public:
  Watched(Workers& inner, const FitOptions& options) : inner_(inner), options_(options) {}

  void Run(std::span<const Job> jobs,
           const std::function<void(std::size_t, Prediction)>& done) override {
    inner_.Run(jobs, [&](std::size_t i, Prediction answer) {
      done(i, std::move(answer));
      const std::lock_guard<std::mutex> lock(mutex_);
      ++progress_.evaluations;
      Tell();
    });
  }

  void Phase(const std::string& phase, std::size_t expected_more) {
    const std::lock_guard<std::mutex> lock(mutex_);
    progress_.phase = phase;
    progress_.expected = progress_.evaluations + expected_more;
    Tell();
  }
  void Best(double cost, const std::vector<double>& theta) {
    const std::lock_guard<std::mutex> lock(mutex_);
    progress_.best_cost = cost;
    progress_.best_theta = theta;
    Tell();
  }

 private:
  void Tell() const {
    if (options_.progress) options_.progress(progress_);
  }
  Workers& inner_;
  const FitOptions& options_;
  std::mutex mutex_;
  FitProgress progress_;
};

void CheckProblem(const FitProblem& problem) {
  if (problem.parameters.empty()) {
    throw Error("a study without parameters", "parameters", "name at least one");
  }
  for (const Parameter& p : problem.parameters) Check(p);
  if (problem.trials.empty()) {
    throw Error("a study without a trial", "trials", "name at least one");
  }
  for (const FitTrial& trial : problem.trials) {
    if (!trial.observations->has_sigma) {
      throw Error("the data carry no covariances", "tracks",
                  "fit to tracks; a run is compared by `correlate`");
    }
  }
}

// Mean square of residuals in sigmas from which on it is the model that does not fit, and not the
// covariances that are somewhat wrong; as in an alignment.
constexpr double kNotNoise = 4.0;

// What the solver's steps need before anything else is known: where the data sit beside the model
// at each candidate, and how much of the model's answer is its solver's noise.
std::vector<Candidate> Begin(const FitProblem& problem, const FitOptions& options,
                             Evaluator& evaluator, std::vector<double>* noise) {
  std::vector<std::vector<double>> points(1);
  for (const Parameter& p : problem.parameters) points[0].push_back(p.start);
  if (options.search.screened > 0) {
    for (auto& point :
         LatinHypercube(problem.parameters, static_cast<std::size_t>(options.search.screened),
                        options.search.seed)) {
      points.push_back(std::move(point));
    }
  }
  std::vector<Evaluator::Request> beside;
  std::vector<Stamps> stamps;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    if (problem.trials[t].tighter == nullptr) continue;
    const Observations& o = *problem.trials[t].observations;
    for (Fidelity fidelity : {Fidelity::kTighter, Fidelity::kMain}) {
      beside.push_back({t, points[0], "noise", fidelity});
      stamps.push_back(o.StampsAt(o.Start()));
    }
  }
  std::vector<Evaluator::Answer> answers;
  std::vector<Candidate> candidates =
      Screen(problem, options, points, evaluator, beside, stamps, &answers);
  noise->assign(problem.trials.size(), 0.0);
  for (std::size_t i = 0; i + 1 < answers.size(); i += 2) {
    if (answers[i]->status == ModelStatus::kGood && answers[i + 1]->status == ModelStatus::kGood) {
      (*noise)[beside[i].trial] = RmsDifference(*answers[i], *answers[i + 1]);
    }
  }
  return candidates;
}

// The candidates to carry on, best first. The study's own start is always among them: a person
// chose it.
std::vector<std::size_t> Choose(const std::vector<Candidate>& candidates, int wanted) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (candidates[i].usable) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return candidates[a].misfit < candidates[b].misfit;
  });
  const auto count = static_cast<std::size_t>(std::max(1, wanted));
  if (order.size() > count) {
    const bool own = candidates[0].usable;
    const bool there =
        std::find(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count),
                  std::size_t{0}) != order.begin() + static_cast<std::ptrdiff_t>(count);
    order.resize(count);
    if (own && !there) order.back() = 0;
  }
  return order;
}

// The places of least cost, at most `wanted`, none within a twentieth of the range of every
// parameter of one that is better.
std::vector<std::size_t> Separate(const std::vector<Parameter>& parameters,
                                  const std::vector<std::vector<double>>& points,
                                  const std::vector<double>& costs, std::size_t wanted) {
  constexpr double kNear = 0.05;
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return costs[a] < costs[b]; });
  std::vector<std::size_t> out;
  for (std::size_t i : order) {
    if (out.size() >= wanted || !std::isfinite(costs[i])) break;
    const bool close = std::any_of(out.begin(), out.end(), [&](std::size_t k) {
      for (std::size_t j = 0; j < parameters.size(); ++j) {
        const Parameter& p = parameters[j];
        const double range = ToInternal(p, p.high) - ToInternal(p, p.low);
        const double away = ToInternal(p, points[i][j]) - ToInternal(p, points[k][j]);
        if (std::abs(away) > kNear * range) return false;
      }
      return true;
    });
    if (!close) out.push_back(i);
  }
  return out;
}

void Sort(std::vector<StartResult>* starts) {
  std::stable_sort(starts->begin(), starts->end(), [](const StartResult& a, const StartResult& b) {
    if ((a.cost < 0.0) != (b.cost < 0.0)) return b.cost < 0.0;
    return a.cost < b.cost;
  });
}

}  // namespace

FitResult Fit(const FitProblem& problem, const FitOptions& options) {
  CheckProblem(problem);
  FitResult r;
  r.parameters.resize(problem.parameters.size());
  r.trials.resize(problem.trials.size());
  for (std::size_t t = 0; t < problem.trials.size(); ++t) r.trials[t].name = problem.trials[t].name;
  std::unique_ptr<Workers> local;
  if (options.where == nullptr) local = LocalWorkers(options.workers);
  Watched workers(options.where != nullptr ? *options.where : *local, options);

  // A stage takes some rounds of a trial point and differences; what follows, known counts.
  const std::size_t p = problem.parameters.size(), trials = problem.trials.size();
  const std::size_t per_stage = trials * (3 * (1 + p) + 1);
  const std::size_t starts_wanted = static_cast<std::size_t>(std::max(1, options.search.starts));
  const std::size_t leading = starts_wanted * per_stage * (options.stages.size() + 1);
  const std::size_t sharp = trials * (2 * (1 + 2 * p) + 1);
  const std::size_t profiles =
      options.profile.wanted ? trials * 2 * p * options.profile.levels.size() * 3 : 0;
  const std::size_t screen = trials * (static_cast<std::size_t>(options.search.screened) + 3);

  workers.Phase("screening", screen + leading + sharp + profiles);
  Evaluator beginning(problem, workers);
  std::vector<double> noise;
  const std::vector<Candidate> candidates = Begin(problem, options, beginning, &noise);
  const std::vector<std::size_t> chosen = Choose(candidates, options.search.starts);
  r.evaluations = beginning.records();
  if (chosen.empty()) {
    r.status = candidates[0].failed ? FitStatus::kModelFailed : FitStatus::kNotAligned;
    r.message = candidates[0].message;
    for (std::size_t t = 0; t < candidates[0].alignment.size(); ++t) {
      r.trials[t].alignment = candidates[0].alignment[t];
    }
    return r;
  }

  workers.Phase(chosen.size() > 1 ? fmt::format("{} starts", chosen.size()) : "the way there",
                leading + sharp + profiles);
  std::vector<std::unique_ptr<StageRunner>> runners, retired;
  auto add = [&](const Candidate& from) {
    const auto start = static_cast<int>(runners.size() + retired.size());
    runners.push_back(std::make_unique<StageRunner>(problem, options, from, workers, start));
    runners.back()->SetModelNoise(noise);
    runners.back()->on_best = [&workers](double cost, const std::vector<double>& theta) {
      workers.Best(cost, theta);
    };
  };
  for (std::size_t i : chosen) add(candidates[i]);
  // A thread per start; how many simulate at a time is the workers' matter.
  std::vector<std::uint8_t> failed(runners.size(), 0);
  auto lead = [&](std::size_t from, std::size_t to) {
    failed.resize(runners.size(), 0);
    ParallelFor(runners.size(), runners.size(), [&](std::size_t s) {
      for (std::size_t i = from; i < std::min(to, runners[s]->stages()) && !failed[s]; ++i) {
        failed[s] = runners[s]->Lead(i) ? 0 : 1;
      }
    });
  };
  lead(0, 1);
  // What the first stage leaves open is scattered over its bounds, and looked at a stage further.
  StageRunner* first = nullptr;
  for (std::size_t s = 0; s < runners.size(); ++s) {
    if (failed[s] || runners[s]->stages() < 2) continue;
    if (first == nullptr || runners[s]->misfit() < first->misfit()) first = runners[s].get();
  }
  if (first != nullptr && options.search.screened > 0) {
    std::vector<std::vector<double>> points = first->ScatterOpen(
        LatinHypercube(problem.parameters, static_cast<std::size_t>(options.search.screened),
                       options.search.seed + 1));
    if (!points.empty()) {
      points.push_back(Values(problem.parameters, first->u().data()));
      const std::vector<double> costs = first->CostsAt(points, 1);
      retired = std::move(runners);
      runners.clear();
      failed.clear();
      for (std::size_t i : Separate(problem.parameters, points, costs, starts_wanted)) {
        add(first->candidate());
        runners.back()->MoveTo(points[i], *first);
      }
    }
  }
  lead(1, std::numeric_limits<std::size_t>::max());
  StageRunner* best = nullptr;
  for (const auto& runner : runners) {
    if (runner->result().cost < 0.0) continue;
    if (best == nullptr || runner->result().cost < best->result().cost) best = runner.get();
  }
  auto finish = [&] {
    for (const auto& runner : retired) {
      const auto& records = runner->evaluator().records();
      r.evaluations.insert(r.evaluations.end(), records.begin(), records.end());
    }
    for (const auto& runner : runners) {
      const auto& records = runner->evaluator().records();
      r.evaluations.insert(r.evaluations.end(), records.begin(), records.end());
      StartResult start = runner->result();
      if (runner.get() == best) r.stages = start.stages;
      r.starts.push_back(std::move(start));
    }
    if (best == nullptr) r.stages = runners.front()->result().stages;
    Sort(&r.starts);
  };
  if (best == nullptr) {
    r.status = FitStatus::kModelFailed;
    r.message = runners.front()->message();
    finish();
    return r;
  }
  for (std::size_t t = 0; t < trials; ++t) r.trials[t].alignment = best->candidate().alignment[t];

  workers.Phase("polishing", sharp + profiles);
  best->Polish();

  // Sharpening: where the model's own noise tells, samples count less.
  workers.Phase("sharpening", sharp + profiles);
  std::vector<Observations> weighed(trials);
  std::vector<const Observations*> data;
  std::vector<RowWhitening> whitening(trials);
  std::vector<const RowWhitening*> whiteners;
  for (std::size_t t = 0; t < trials; ++t) {
    const FitTrial& trial = problem.trials[t];
    weighed[t] = *trial.observations;
    if (trial.tighter != nullptr) {
      const std::vector<double> theta = Values(problem.parameters, best->u().data());
      const Evaluator::Answer tight =
          best->evaluator().Evaluate({{t, theta, "noise", Fidelity::kTighter}}).front();
      if (tight->status == ModelStatus::kGood) {
        const Prediction& plain = *best->point().prediction[t];
        noise[t] = std::max(noise[t], RmsDifference(plain, *tight));
        r.trials[t].less_weight = WeighSections(*trial.observations, plain, *tight,
                                                std::max(1, options.error_sections), &weighed[t]);
      }
    }
    r.trials[t].model_noise = std::max(noise[t], best->point().prediction[t]->noise);
    data.push_back(&weighed[t]);
    whiteners.push_back(nullptr);
  }
  best->SetModelNoise(noise);
  bool good = best->Sharpen(data, whiteners, "sharpened");
  if (good && options.whiten) {
    Eigen::MatrixXd J;
    good = best->reduced().CentralSensitivity(best->u(), best->point(), &J);
    bool coloured = false;
    for (std::size_t t = 0; t < trials && good; ++t) {
      const RegistrationFit& at = best->point().registration[t];
      const Eigen::Index rows = at.residual.size();
      // What is left is then the model's own error. Its likeness to noise would weigh frame and
      // calibration's draw, and let both drift.
      if (at.SumOfSquares() > kNotNoise * 3.0 * static_cast<double>(at.known)) continue;
      Eigen::MatrixXd A(rows, J.cols() + at.jacobian.cols());
      A << J.middleRows(best->reduced().first_row(t), rows), at.jacobian;
      r.trials[t].noise = FitSeriesNoise(weighed[t], at.residual, A);
      whitening[t] = RowWhitening(weighed[t], r.trials[t].noise);
      whiteners[t] = &whitening[t];
      coloured = coloured || !whitening[t].identity();
    }
    if (good && coloured) good = best->Sharpen(data, whiteners, "whitened");
  }
  r.status = best->status();
  r.message = best->message();
  if (good && FillEstimate(problem, *best, &r)) {
    FillCovariance(problem, data, whiteners, options, &r);
    if (options.profile.wanted) {
      workers.Phase("profiles", profiles);
      FillProfiles(problem, best->reduced(), best->u(), best->point(), options, &r);
    }
    Judge(problem, best->reduced(), best->point(), &r);
  }
  finish();
  return r;
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
