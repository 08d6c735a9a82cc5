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

bool WayBends(const FitProblem& problem, StageRunner& runner, const FitResult& r) {
  constexpr double kBent = 0.2;  // standard errors: 2% of one where it adds in quadrature
  const std::vector<double>& u = runner.u();
  std::vector<double> moved = u;
  Eigen::MatrixXd J = r.sensitivity;
  Eigen::VectorXd way(J.cols());
  bool far = false;
  for (std::size_t j = 0; j < u.size(); ++j) {
    const ParameterEstimate& e = r.parameters[j];
    const auto c = static_cast<Eigen::Index>(j);
    J.col(c) *= Slope(problem.parameters[j], e.value);
    moved[j] = ToInternal(problem.parameters[j], e.value + e.model_shift);
    way(c) = moved[j] - u[j];
    // Below a standard error its second order is less than that.
    far = far || std::abs(e.model_shift) > e.sigma_data;
  }
  if (!far) return false;
  ReducedProblem::Point there;
  const bool good = runner.reduced().At(moved, &there, "ladder");
  runner.reduced().TakeStarts(runner.point());
  if (!good) return false;
  const Eigen::MatrixXd projected = runner.reduced().Project(runner.point(), J);
  const Eigen::MatrixXd bend =
      runner.reduced().Project(runner.point(), there.residual - runner.point().residual - J * way);
  const GaussNewton second = StepAndSigma(projected, bend.col(0));
  return (second.step.cwiseAbs().array() > kBent * second.sigma.array()).any();
}

namespace {

// The extrapolated model at one point, as a correction of the base: what all trials' rungs tell.
class Extrapolated {
 public:
  Extrapolated(const FitProblem& problem, const Ladder& ladder, StageRunner& runner)
      : problem_(problem), ladder_(ladder), runner_(runner) {
    for (const ReducedProblem::Part& part : runner.reduced().parts()) {
      observations_.push_back(part.observations);
    }
  }

  // With the rung `below` as the other one of the estimate; null: a rung failed there.
  std::shared_ptr<Correction> At(const std::vector<double>& u, std::size_t below) const {
    const std::vector<double> theta = Values(problem_.parameters, u.data());
    const std::size_t top = ladder_.top(), base = ladder_.result().base;
    std::vector<Evaluator::Request> wanted;
    for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
      for (std::size_t rung : {top, below, base}) {
        wanted.push_back({t, theta, "ladder", FidelityOfRung(rung), false});
      }
    }
    const std::vector<Evaluator::Answer> rungs = runner_.evaluator().Evaluate(wanted);
    Correction::Difference more;
    for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
      const Prediction& fine = *rungs[3 * t];
      const Prediction& other = *rungs[3 * t + 1];
      const Prediction& coarse = *rungs[3 * t + 2];
      for (const Prediction* p : {&fine, &other, &coarse}) {
        if (p->status != ModelStatus::kGood) return nullptr;
      }
      const Observations& o = *observations_[t];
      const double known = Richardson(problem_.trials[t], below, top);
      more.push_back(Correction::DifferenceOf(o, coarse, fine) +
                     (known > 0.0 ? known : 1.0) * Correction::DifferenceOf(o, other, fine));
    }
    return std::make_shared<Correction>(
        problem_.parameters, observations_,
        Eigen::Map<const Eigen::VectorXd>(u.data(), static_cast<Eigen::Index>(u.size())),
        std::move(more));
  }

 private:
  const FitProblem& problem_;
  const Ladder& ladder_;
  StageRunner& runner_;
  std::vector<const Observations*> observations_;
};

}  // namespace

WaysOfError FollowError(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
                        const FitResult& r) {
  constexpr int kMostRounds = 6;  // each is shorter than the last by the error's relative size
  WaysOfError out;
  const Extrapolated model(problem, ladder, runner);
  const std::size_t top = ladder.top();
  const Eigen::VectorXd sigma = runner.sigma();
  auto values = [&](const std::vector<double>& u) {
    Eigen::VectorXd shift(static_cast<Eigen::Index>(u.size()));
    for (std::size_t j = 0; j < u.size(); ++j) {
      shift(static_cast<Eigen::Index>(j)) =
          FromInternal(problem.parameters[j], u[j]) - r.parameters[j].value;
    }
    return shift;
  };
  std::vector<double> u = runner.u(), seen = u;  // where the rungs were evaluated last
  if (ladder.correction() != nullptr) {          // the finest is known there
    const Eigen::VectorXd centre = ladder.correction()->centre();
    seen.assign(centre.data(), centre.data() + centre.size());
  }
  bool settled = false;
  for (; out.rounds < kMostRounds && !settled; ++out.rounds) {
    if (out.rounds > 0) seen = u;
    const std::shared_ptr<Correction> correction = model.At(seen, top - 1);
    if (correction == nullptr) return out;
    const std::vector<double> next = runner.SolutionWith(correction, u);
    if (next.empty()) return out;
    settled = true;
    for (std::size_t j = 0; j < u.size(); ++j) {
      const double most = 0.2 * sigma(static_cast<Eigen::Index>(j));  // as WayBends has it
      settled = settled && std::abs(next[j] - u[j]) <= most;
    }
    u = next;
  }
  if (!settled) return out;
  out.first = values(u);
  // The other estimate leads to near there.
  if (RungsCompared(problem.trials.front(), top).size() > 2) {
    const std::shared_ptr<Correction> correction = model.At(seen, 0);
    if (correction == nullptr) return out;
    const std::vector<double> other = runner.SolutionWith(correction, u);
    if (!other.empty()) out.second = values(other);
  }
  return out;
}

}  // namespace unfurl::correlate
