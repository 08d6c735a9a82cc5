#include "correlate/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "correlate/fit_covariance.h"
#include "correlate/reduced_problem.h"
#include "correlate/solver.h"

namespace unfurl::correlate {

namespace {

// Beyond this the prediction is asked at new stamps, and the stage solved again: to this far the
// velocities carry it. Accelerations of 1 km/s^2 at impacts make 1e-6 m of it.
constexpr double kOffsetSettled = 5e-5;  // [s]

// Of a standard error: how near to its minimum a stage that only leads the way has to come.
constexpr double kLeadingTolerance = 0.5;

std::vector<std::string> MarkNames(const Observations& o) {
  std::vector<std::string> names;
  for (const MarkSeries& m : o.marks) names.push_back(m.name);
  return names;
}

// Where in time and space the data sit beside the model at the start parameters.
bool AlignStart(const FitProblem& problem, const FitOptions& options, Evaluator& evaluator,
                FitResult* result) {
  const Observations& o = *problem.observations;
  // Positions and velocities on half the data's own step carry any motion that the data can show.
  const double grid = std::clamp(0.5 * MedianStep(o.marks.front().t), 1e-3, 1e-2);
  std::vector<double> theta;
  for (const Parameter& p : problem.parameters) theta.push_back(p.start);
  // Late motion at wrong parameters aligns anything with anything: where there are stages, the
  // first one's horizon is what is aligned.
  double horizon = o.End() - o.Start();
  if (!options.stages.empty()) {
    horizon = std::min(horizon, *std::min_element(options.stages.begin(), options.stages.end()));
  }
  const SampledModel sampled(*problem.model, theta, MarkNames(o), 0.0, horizon, grid);
  EvaluationRecord record;
  record.theta = theta;
  record.purpose = "alignment";
  record.status = sampled.good() ? ModelStatus::kGood : ModelStatus::kFailed;
  record.message = sampled.message();
  evaluator.Note(record);
  if (!sampled.good()) {
    result->status = FitStatus::kModelFailed;
    result->message = "the model failed at the start parameters: " + sampled.message();
    return false;
  }
  result->alignment = Align(o, sampled, options.align);
  // An alignment that did not settle is start enough; one of unrelated records is not.
  if (result->alignment.status == AlignStatus::kGood ||
      result->alignment.status == AlignStatus::kNotConverged) {
    return true;
  }
  result->status = FitStatus::kNotAligned;
  result->message = result->alignment.message;
  return false;
}

void FillPrediction(const FitProblem& problem, const std::vector<double>& u,
                    ReducedProblem& reduced, const ReducedProblem::Point& point,
                    Evaluator& evaluator, FitResult* r) {
  const std::size_t p = problem.parameters.size();
  const std::vector<double> theta = Values(problem.parameters, u.data());
  std::vector<Evaluator::Request> beside;
  if (problem.finer != nullptr) beside.push_back({problem.finer, theta, "finer model", true});
  Eigen::MatrixXd forward, backward;
  ReducedProblem::Change change_forward, change_backward;
  // The finer model takes longest: it goes first, beside the backward differences.
  const bool two_sided = reduced.Sensitivity(u, point, -1, &backward, &change_backward, beside) &&
                         reduced.Sensitivity(u, point, +1, &forward, &change_forward);
  if (!two_sided) {
    r->status = FitStatus::kModelFailed;
    r->message = "the model could not be evaluated beside the estimate";
    return;
  }
  r->prediction = *point.prediction;
  r->registration = point.registration;
  r->offset_ref = reduced.offset_ref();
  r->model_noise = point.prediction->noise;
  r->sensitivity = 0.5 * (forward + backward);
  r->change = change_forward;
  for (std::size_t j = 0; j < p; ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    ParameterEstimate& e = r->parameters[j];
    e.value = theta[j];
    const double sum = (forward.col(column) + backward.col(column)).norm();
    e.kink = sum > 0.0 ? (forward.col(column) - backward.col(column)).norm() / sum : 0.0;
    const double slope = Slope(problem.parameters[j], e.value);
    r->sensitivity.col(column) /= slope;
    for (std::size_t m = 0; m < change_forward[j].size(); ++m) {
      r->change[j][m] = (change_forward[j][m] + change_backward[j][m]) * (0.5 / slope);
    }
  }
  if (problem.finer == nullptr) return;
  const Evaluator::Answer finer = evaluator.Evaluate(beside.front());
  if (finer->status != ModelStatus::kGood) {
    r->message =
        "the finer model failed, so the model's own error is not in the standard errors: " +
        finer->message;
    return;
  }
  for (std::size_t m = 0; m < finer->marks.size(); ++m) {
    r->model_error.push_back(problem.finer_factor *
                             (finer->marks[m].p - point.prediction->marks[m].p));
  }
}

}  // namespace

FitResult Fit(const FitProblem& problem, const FitOptions& options) {
  if (problem.parameters.empty()) {
    throw Error("a study without parameters", "parameters", "name at least one");
  }
  for (const Parameter& p : problem.parameters) Check(p);
  const Observations& all = *problem.observations;
  if (!all.has_sigma) {
    throw Error("the data carry no covariances", "tracks",
                "fit to tracks; a run is compared by `correlate`");
  }

  FitResult r;
  r.parameters.resize(problem.parameters.size());
  Evaluator evaluator(options.workers);
  if (!AlignStart(problem, options, evaluator, &r)) {
    r.evaluations = evaluator.records();
    return r;
  }
  Registration at = r.alignment.at;
  std::vector<double> u;
  for (const Parameter& p : problem.parameters) u.push_back(ToInternal(p, p.start));

  std::vector<double> ends;
  for (double end : options.stages) {
    if (end + at.offset < all.End()) ends.push_back(end);
  }
  std::sort(ends.begin(), ends.end());
  ends.push_back(std::numeric_limits<double>::infinity());
  const double sigma = TypicalSigma(all);

  Observations data;
  for (std::size_t s = 0; s < ends.size(); ++s) {
    const bool last = s + 1 == ends.size();
    data = Cut(all, {-std::numeric_limits<double>::infinity(), ends[s] + at.offset});
    constexpr std::size_t kFewest = 50;  // samples; a shorter horizon leads nowhere
    if (data.size() < kFewest && !last) continue;
    StageResult stage;
    stage.end = ends[s];
    stage.samples = data.size();
    constexpr int kMaxRounds = 4;
    std::vector<double> steps;
    for (int round = 0; round < kMaxRounds; ++round) {
      const double offset_ref = at.offset;
      evaluator.SetStamps(data.StampsAt(offset_ref), static_cast<int>(s));
      ReducedProblem reduced(*problem.model, problem.parameters, data, offset_ref, at,
                             options.align.registration, evaluator);
      if (round > 0) reduced.TakeSteps(steps);
      FitProgress progress{static_cast<int>(s), static_cast<int>(ends.size()), 0, 0.0, {}};
      SolverOptions solver;
      solver.max_iterations = options.max_iterations;
      solver.central_from_start = round > 0;
      // Only the end has to be sharp; until then a stage leads the way.
      solver.step_tolerance = last && round > 0 ? options.step_tolerance : kLeadingTolerance;
      solver.difference_target = options.difference_sigma * sigma;
      ReducedProblem::Point point;
      if (reduced.At(u, &point, "trial")) {
        solver.difference_target =
            std::max(solver.difference_target, options.noise_factor * point.prediction->noise);
      }
      solver.on_iteration = [&](double cost, const std::vector<double>& best) {
        progress.best_cost = cost;
        progress.best_theta = best.empty() ? best : Values(problem.parameters, best.data());
      };
      evaluator.on_batch = [&] {
        progress.evaluations = evaluator.count();
        if (options.progress) options.progress(progress);
      };
      const SolverResult solved = Solve(reduced, problem.parameters, u, solver);
      stage.iterations += solved.iterations;
      stage.solver_message = solved.message;
      stage.cost = solved.cost;
      u = solved.u;
      steps = reduced.steps();
      stage.theta = Values(problem.parameters, u.data());
      if (solved.status == SolverStatus::kStartFailed || !reduced.At(u, &point, "trial")) {
        r.status = FitStatus::kModelFailed;
        r.message = solved.message;
        if (point.prediction) r.message += ": " + point.prediction->message;
        break;
      }
      at = point.registration.at;
      const bool settled = std::abs(at.offset - offset_ref) <= kOffsetSettled;
      if (last && (round == 0 || (!settled && round + 1 < kMaxRounds))) continue;
      r.status = solved.status == SolverStatus::kConverged ? FitStatus::kConverged
                                                           : FitStatus::kNotConverged;
      r.message = solved.message;
      if (last) {
        FillPrediction(problem, u, reduced, point, evaluator, &r);
        if (!r.prediction.marks.empty()) FillCovariance(problem, data, options, &r);
      }
      break;
    }
    evaluator.on_batch = nullptr;
    r.stages.push_back(stage);
    if (r.status == FitStatus::kModelFailed) break;
  }
  r.evaluations = evaluator.records();
  return r;
}

}  // namespace unfurl::correlate
