#include "correlate/fit/ladder_error.h"

#include <cmath>

#include "correlate/fit/solver.h"

namespace unfurl::correlate {

namespace {

double ErrorOf(const FitTrial& trial, std::size_t rung) {
  return rung == 0 ? trial.model_relative_error : trial.rungs[rung - 1].error;
}

// The rungs compared: the finest two, and the lowest where it makes a second estimate.
std::vector<std::size_t> RungsCompared(const FitTrial& trial, std::size_t top) {
  std::vector<std::size_t> rungs = {top, top - 1};
  if (top >= 2 && Richardson(trial, 0, top) > 0.0) rungs.push_back(0);
  return rungs;
}

std::vector<Evaluator::Request> RequestsOf(const FitProblem& problem, std::size_t trial,
                                           const Ladder& ladder, const StageRunner& runner) {
  // Where the finest was seen last: within the tolerance of the estimate.
  const double* u =
      ladder.correction() != nullptr ? ladder.correction()->centre().data() : runner.u().data();
  const std::vector<double> theta = Values(problem.parameters, u);
  std::vector<Evaluator::Request> out;
  for (std::size_t rung : RungsCompared(problem.trials[trial], ladder.top())) {
    out.push_back({trial, theta, "ladder", FidelityOfRung(rung), false});
  }
  return out;
}

// The lowest rung at two tolerances, at the point of RequestsOf.
std::vector<Evaluator::Request> ToleranceRequests(const Evaluator::Request& like) {
  std::vector<Evaluator::Request> out(2, like);
  out[0].fidelity = Fidelity::kTighter;
  out[1].fidelity = FidelityOfRung(0);
  for (Evaluator::Request& r : out) r.purpose = "noise";
  return out;
}

}  // namespace

double Richardson(const FitTrial& trial, std::size_t below, std::size_t top) {
  const double coarse = ErrorOf(trial, below), fine = ErrorOf(trial, top);
  return fine > 0.0 && coarse > fine ? fine / (coarse - fine) : 0.0;
}

Eigen::VectorXd FloorOf(const FitProblem& problem, std::size_t base, std::size_t top,
                        const ReducedProblem& reduced, const ReducedProblem::Point& at,
                        const Eigen::MatrixXd& J, const std::vector<Evaluator::Answer>& coarse,
                        const std::vector<Evaluator::Answer>& fine) {
  // One column, of what is left; then the Gauss-Newton step that it would cause. A third of its
  // square is the variance of a uniform density over that way about its beginning.
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(reduced.rows(), 1);
  for (std::size_t i = 0; i < reduced.parts().size(); ++i) {
    const ReducedProblem::Part& part = reduced.parts()[i];
    const FitTrial& trial = problem.trials[part.trial];
    double factor = Richardson(trial, base, top);
    if (factor == 0.0 && base + 1 == top) factor = 1.0;
    if (factor == 0.0) continue;
    const Change left = Difference(*part.observations, *coarse[i], *fine[i], factor);
    Eigen::MatrixXd data = WhitenedSensitivity(*part.observations, *at.prediction[i],
                                               part.reference, at.registration[i].at, {left});
    if (part.whitening != nullptr) part.whitening->Apply(data);
    rows.middleRows(reduced.first_row(i), data.rows()) = data;
  }
  return StepAndSigma(reduced.Project(at, J), reduced.Project(at, rows)).step.cwiseAbs() /
         std::sqrt(3.0);
}

std::vector<Evaluator::Request> RungsWanted(const FitProblem& problem, const Ladder& ladder,
                                            const StageRunner& runner) {
  std::vector<Evaluator::Request> out;
  if (!ladder.wanted() || !ladder.failure().empty()) return out;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    for (Evaluator::Request& r : RequestsOf(problem, t, ladder, runner)) out.push_back(r);
    if (problem.trials[t].tighter == nullptr) continue;
    for (Evaluator::Request& r : ToleranceRequests(out.back())) out.push_back(r);
  }
  return out;
}

void FillWhatIsLeft(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
                    FitResult* r) {
  const std::size_t top = ladder.top();
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const FitTrial& trial = problem.trials[t];
    TrialResult& out = r->trials[t];
    if (!ladder.failure().empty()) {
      out.error_check_failure = ladder.failure();
      continue;
    }
    const std::vector<Evaluator::Request> asked = RequestsOf(problem, t, ladder, runner);
    const std::vector<Evaluator::Answer> rungs = runner.evaluator().Evaluate(asked);
    const bool third = rungs.size() > 2;
    for (const Evaluator::Answer& rung : rungs) {
      if (rung->status != ModelStatus::kGood) out.error_check_failure = rung->message;
    }
    if (!out.error_check_failure.empty()) continue;
    const double known = Richardson(trial, top - 1, top);
    const Observations& o = *trial.observations;
    out.model_error = Difference(o, *rungs[1], *rungs[0], known > 0.0 ? known : 1.0);
    if (third) {
      const Change other = Difference(o, *rungs[2], *rungs[0], Richardson(trial, 0, top));
      out.model_doubt = Sum(out.model_error, -1.0, other);
    }
    if (trial.tighter != nullptr) {
      const std::vector<Evaluator::Answer> two =
          runner.evaluator().Evaluate(ToleranceRequests(asked.front()));
      if (two[0]->status == ModelStatus::kGood && two[1]->status == ModelStatus::kGood) {
        out.model_scatter = Difference(o, *two[1], *two[0]);
      }
    }
    out.error_check = ErrorCheck::kLadder;
  }
}

}  // namespace unfurl::correlate
