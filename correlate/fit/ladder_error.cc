#include "correlate/fit/ladder_error.h"

#include <cmath>

#include "correlate/fit/solver.h"

namespace unfurl::correlate {

namespace {

double ErrorOf(const FitTrial& trial, std::size_t rung) {
  return rung == 0 ? trial.model_relative_error : trial.rungs[rung - 1].error;
}

struct Left {
  std::vector<Eigen::Matrix3Xd> marks;  // [m]
  Eigen::VectorXd events;               // in their sigmas
};

Left LeftOf(const Observations& o, double factor, const Prediction& below, const Prediction& top) {
  Left left;
  for (std::size_t m = 0; m < top.marks.size(); ++m) {
    left.marks.push_back(factor * (top.marks[m].p - below.marks[m].p));
  }
  left.events = factor * EventSensitivity(o, below, top, 1.0);
  return left;
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
    const Left left = LeftOf(*part.observations, factor, *coarse[i], *fine[i]);
    Eigen::MatrixXd data = WhitenedSensitivity(*part.observations, *at.prediction[i],
                                               at.registration[i].at.X_WM, {left.marks});
    data.middleRows(3 * static_cast<Eigen::Index>(part.observations->size()), left.events.size()) =
        left.events;
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
    Left left = LeftOf(o, known > 0.0 ? known : 1.0, *rungs[1], *rungs[0]);
    if (third) {
      const Left other = LeftOf(o, Richardson(trial, 0, top), *rungs[2], *rungs[0]);
      for (std::size_t m = 0; m < left.marks.size(); ++m) {
        out.model_doubt.push_back(left.marks[m] - other.marks[m]);
      }
      out.event_doubt = left.events - other.events;
    }
    if (trial.tighter != nullptr) {
      const std::vector<Evaluator::Answer> two =
          runner.evaluator().Evaluate(ToleranceRequests(asked.front()));
      if (two[0]->status == ModelStatus::kGood && two[1]->status == ModelStatus::kGood) {
        Left scatter = LeftOf(o, 1.0, *two[1], *two[0]);
        out.model_scatter = std::move(scatter.marks);
        out.event_scatter = std::move(scatter.events);
      }
    }
    out.model_error = std::move(left.marks);
    out.event_error = std::move(left.events);
    out.error_check = ErrorCheck::kLadder;
  }
}

}  // namespace unfurl::correlate
