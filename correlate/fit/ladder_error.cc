#include "correlate/fit/ladder_error.h"

#include <cmath>

#include "correlate/fit/broyden.h"
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

namespace {

// Of u: what the end of a way may be off by. A fifth of what an interval reaches beyond that end
// for other reasons (the data, the doubt about the way): 2% of it where it adds in quadrature.
Eigen::VectorXd ToleranceOfWay(const FitProblem& problem, const FitResult& r) {
  constexpr double kPart = 0.2;  // sqrt(1 + 0.2^2) = 1.02
  Eigen::VectorXd out(static_cast<Eigen::Index>(r.parameters.size()));
  for (std::size_t j = 0; j < r.parameters.size(); ++j) {
    const ParameterEstimate& e = r.parameters[j];
    out(static_cast<Eigen::Index>(j)) = kPart * std::hypot(e.sigma_data, e.sigma_doubt) /
                                        std::abs(Slope(problem.parameters[j], e.value));
  }
  return out;
}

// `top` with `part` times what it has more than `below`: positions, velocities and numbers.
Evaluator::Answer Extrapolated(const Observations& o, const std::vector<Parameter>& parameters,
                               double part, const std::vector<double>& theta,
                               const Prediction& below, const Prediction& top) {
  const Correction more(parameters, {&o},
                        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(theta.size())),
                        {part * Correction::DifferenceOf(o, below, top)});
  return std::make_shared<const Prediction>(more.Apply(0, theta, top));
}

// The residuals of the extrapolated model at u, with `below` as the other rung; empty: a rung
// failed there.
Eigen::VectorXd ResidualOfExtrapolated(const FitProblem& problem, const Ladder& ladder,
                                       StageRunner& runner, const std::vector<double>& u,
                                       std::size_t below,
                                       const std::vector<Evaluator::Request>& beside = {}) {
  const std::vector<double> theta = Values(problem.parameters, u.data());
  std::vector<Evaluator::Request> wanted;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    for (std::size_t rung : {ladder.top(), below}) {
      wanted.push_back({t, theta, "ladder", FidelityOfRung(rung), false});
    }
  }
  const std::size_t asked = wanted.size();
  wanted.insert(wanted.end(), beside.begin(), beside.end());
  std::vector<Evaluator::Answer> rungs = runner.evaluator().Evaluate(wanted);
  rungs.resize(asked);
  std::vector<Evaluator::Answer> model;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const Prediction &top = *rungs[2 * t], &other = *rungs[2 * t + 1];
    if (top.status != ModelStatus::kGood || other.status != ModelStatus::kGood) return {};
    const double known = Richardson(problem.trials[t], below, ladder.top());
    model.push_back(Extrapolated(*runner.reduced().parts()[t].observations, problem.parameters,
                                 known > 0.0 ? known : 1.0, theta, other, top));
  }
  ReducedProblem::Point there;
  if (!runner.reduced().CostOf(u, model, &there)) return {};
  return there.residual;
}

Eigen::VectorXd Vector(const std::vector<double>& u) {
  return Eigen::Map<const Eigen::VectorXd>(u.data(), static_cast<Eigen::Index>(u.size()));
}

// The way to the minimum of the extrapolated model: Gauss-Newton steps whose slopes learn from each
// of them [Broyden 1965], in steps measured by standard errors.
class Way {
 public:
  Way(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
      Eigen::MatrixXd projected)
      : problem_(problem), ladder_(ladder), runner_(runner), slopes_(std::move(projected)) {}

  // Looks at the model there, and learns from where it looked before. False: a rung failed.
  bool LookAt(const std::vector<double>& u) {
    // The lowest rung is asked beside the others: StepOfOther wants it where the way ends.
    std::vector<Evaluator::Request> beside;
    const std::vector<double> theta = Values(problem_.parameters, u.data());
    for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
      if (RungsCompared(problem_.trials[t], ladder_.top()).size() <= 2) continue;
      beside.push_back({t, theta, "ladder", FidelityOfRung(0), false});
    }
    Eigen::VectorXd residual =
        ResidualOfExtrapolated(problem_, ladder_, runner_, u, ladder_.top() - 1, beside);
    if (residual.size() == 0) return false;
    if (residual_.size() > 0) Learn(Vector(u) - Vector(u_), residual - residual_);
    u_ = u;
    residual_ = std::move(residual);
    return true;
  }
  Eigen::VectorXd Step() const { return StepAndSigma(slopes_, residual_).step; }
  // That of the other estimate, where LookAt was; empty: a rung failed.
  Eigen::VectorXd StepOfOther(std::size_t below) const {
    const Eigen::VectorXd residual = ResidualOfExtrapolated(problem_, ladder_, runner_, u_, below);
    return residual.size() > 0 ? StepAndSigma(slopes_, residual).step : Eigen::VectorXd();
  }
  const std::vector<double>& u() const { return u_; }

 private:
  void Learn(const Eigen::VectorXd& by, const Eigen::VectorXd& change) {
    const Eigen::VectorXd weights = BroydenWeights(by, StepAndSigma(slopes_, residual_).sigma);
    if (weights.size() > 0) slopes_ += (change - slopes_ * by) * weights.transpose();
  }

  const FitProblem& problem_;
  const Ladder& ladder_;
  StageRunner& runner_;
  Eigen::MatrixXd slopes_;  // of the residuals, projected
  std::vector<double> u_;
  Eigen::VectorXd residual_;
};

// `u` moved by a step, within the bounds.
std::vector<double> Moved(const std::vector<Parameter>& parameters, const std::vector<double>& u,
                          const Eigen::VectorXd& step) {
  std::vector<double> to = u;
  for (std::size_t j = 0; j < u.size(); ++j) {
    const Parameter& p = parameters[j];
    to[j] = StepByValue(p, u[j], step(static_cast<Eigen::Index>(j)));
  }
  return to;
}

// The way that the values go to first order, in u; whether it is so short that its error, a part of
// it, would not show beside data and doubt.
Eigen::VectorXd FirstOrder(const FitProblem& problem, const std::vector<double>& u,
                           const FitResult& r, bool* is_short) {
  Eigen::VectorXd way(static_cast<Eigen::Index>(u.size()));
  *is_short = true;
  for (std::size_t j = 0; j < u.size(); ++j) {
    const ParameterEstimate& e = r.parameters[j];
    way(static_cast<Eigen::Index>(j)) = e.model_shift / Slope(problem.parameters[j], e.value);
    // What the first order leaves out of a shift is a fraction of it; a quarter of one that is as
    // large as data and doubt adds 3% to them (sqrt(1 + 1/16)).
    *is_short = *is_short && std::abs(e.model_shift) <= std::hypot(e.sigma_data, e.sigma_doubt);
  }
  return way;
}

}  // namespace

WaysOfError FollowError(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
                        const FitResult& r) {
  constexpr int kMostRounds = 6;  // each is shorter than the last by the slopes' relative error
  WaysOfError out;
  bool is_short = false;
  const Eigen::VectorXd way = FirstOrder(problem, runner.u(), r, &is_short);
  if (is_short) return out;
  const Eigen::VectorXd tolerance = ToleranceOfWay(problem, r);
  Eigen::MatrixXd J = r.sensitivity;
  for (Eigen::Index j = 0; j < J.cols(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    J.col(j) *= Slope(problem.parameters[i], r.parameters[i].value);
  }
  auto shift = [&](const std::vector<double>& u) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(u.size()));
    for (std::size_t j = 0; j < u.size(); ++j) {
      values(static_cast<Eigen::Index>(j)) =
          FromInternal(problem.parameters[j], u[j]) - r.parameters[j].value;
    }
    return values;
  };
  auto size = [&](const Eigen::VectorXd& step) {
    return step.cwiseAbs().cwiseQuotient(tolerance.cwiseMax(1e-300)).maxCoeff();
  };
  // What the finest rung lacks at the estimate is known; then from the end of the first order on:
  // the rungs themselves say there what is left, and not the lowest one's slopes, which are off by
  // as much as that rung is.
  const std::vector<double> end = Moved(problem.parameters, runner.u(), way);
  Way follow(problem, ladder, runner, runner.reduced().Project(runner.point(), J));
  if (ladder.correction() != nullptr) {
    const Eigen::VectorXd& centre = ladder.correction()->centre();
    follow.LookAt({centre.data(), centre.data() + centre.size()});
  }
  std::vector<double> u = end;
  double last = size(way);
  bool settled = false;
  while (out.rounds < kMostRounds && !settled) {
    if (!follow.LookAt(u)) break;
    ++out.rounds;
    const Eigen::VectorXd step = follow.Step();
    u = Moved(problem.parameters, u, step);
    const double now = size(step), ratio = now / last;
    // What would follow, a geometric row.
    settled = ratio < 1.0 && now * ratio / (1.0 - ratio) <= 1.0;
    last = now;
  }
  if (!settled) {
    if (out.rounds > 0) out.bend = shift(u) - shift(end);
    return out;
  }
  out.first = shift(u);
  // The other estimate leads to near there.
  if (RungsCompared(problem.trials.front(), ladder.top()).size() > 2) {
    const Eigen::VectorXd step = follow.StepOfOther(0);
    if (step.size() > 0) out.second = shift(Moved(problem.parameters, follow.u(), step));
  }
  return out;
}

}  // namespace unfurl::correlate
