#include "correlate/fit/fit_estimate.h"

#include <algorithm>
#include <cmath>

#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

std::vector<LessWeight> WeighSections(const Observations& all, const Prediction& plain,
                                      const Prediction& tight, int sections, Observations* out) {
  // Of the marks' sigma. Below, it adds 5% to it at most: sqrt(1 + 1/9) = 1.05.
  constexpr double kNoticed = 1.0 / 3.0;
  std::vector<LessWeight> less;
  *out = all;
  const double start = all.Start(), span = std::max(1e-12, all.End() - start);
  for (std::size_t m = 0; m < all.marks.size(); ++m) {
    const MarkSeries& mark = all.marks[m];
    for (int s = 0; s < sections; ++s) {
      const double from = start + span * s / sections, to = start + span * (s + 1) / sections;
      double noise = 0.0, sigma = 0.0, n = 0.0;
      std::vector<Eigen::Index> members;
      for (std::size_t i = 0; i < mark.size(); ++i) {
        const bool last = s + 1 == sections;
        if (mark.t[i] < from || (mark.t[i] >= to && !last)) continue;
        const auto column = static_cast<Eigen::Index>(i);
        members.push_back(column);
        noise += (plain.marks[m].p.col(column) - tight.marks[m].p.col(column)).squaredNorm() / 2.0;
        sigma += (mark.cov(0, column) + mark.cov(3, column) + mark.cov(5, column)) / 3.0;
        n += 1.0;
      }
      if (n == 0.0 || noise < kNoticed * kNoticed * sigma) continue;
      less.push_back({mark.name, from, to, std::sqrt(noise / n), sigma / (sigma + noise)});
      for (Eigen::Index column : members) {
        for (Eigen::Index row : {0, 3, 5}) out->marks[m].cov(row, column) += noise / n;
      }
    }
  }
  return less;
}

std::vector<Evaluator::Request> RivalRequests(const FitProblem& problem,
                                              const std::vector<double>& theta) {
  std::vector<Evaluator::Request> out;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const FitTrial& trial = problem.trials[t];
    for (std::size_t i = 0; i < trial.rivals.size(); ++i) {
      out.push_back({t, theta, "rival law", FidelityOfRival(trial, i), false});
    }
    if (!trial.rivals.empty()) out.push_back({t, theta, "trial", Fidelity::kMain, false});
  }
  return out;
}

void FillRivals(const FitProblem& problem, StageRunner& runner, FitResult* r) {
  const std::vector<Evaluator::Request> asked =
      RivalRequests(problem, Values(problem.parameters, runner.u().data()));
  const std::vector<Evaluator::Answer> answers = runner.evaluator().Evaluate(asked);
  std::size_t at = 0;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const FitTrial& trial = problem.trials[t];
    r->trials[t].rivals.assign(trial.rivals.size(), {});
    if (trial.rivals.empty()) continue;
    const Evaluator::Answer& plain = answers[at + trial.rivals.size()];
    for (Change& change : r->trials[t].rivals) {
      const Evaluator::Answer& answer = answers[at++];
      if (answer->status != ModelStatus::kGood || plain->status != ModelStatus::kGood) continue;
      change = Difference(*trial.observations, *plain, *answer);
    }
    ++at;
  }
}

bool FillEstimate(const FitProblem& problem, StageRunner& runner,
                  std::vector<Evaluator::Request> beside, FitResult* r) {
  ReducedProblem& reduced = runner.reduced();
  const std::vector<double>& u = runner.u();
  const ReducedProblem::Point& point = runner.point();
  const std::vector<double> theta = Values(problem.parameters, u.data());
  const std::size_t ladder = beside.size();
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const FitTrial& trial = problem.trials[t];
    if (!trial.rungs.empty()) continue;  // the ladder tells more
    if (trial.finer != nullptr) {
      beside.push_back({t, theta, "finer model", Fidelity::kFiner});
    } else if (trial.tighter != nullptr) {
      beside.push_back({t, theta, "tighter tolerance", Fidelity::kTighter});
    }
  }
  Eigen::MatrixXd forward, backward;
  ReducedProblem::Changes up, down;
  // The finer model takes longest: it goes first, beside the backward differences.
  if (!reduced.Sensitivity(u, point, -1, &backward, &down, beside) ||
      !reduced.Sensitivity(u, point, +1, &forward, &up)) {
    r->status = FitStatus::kModelFailed;
    r->message = "the model could not be evaluated beside the estimate";
    return false;
  }
  r->sensitivity = 0.5 * (forward + backward);
  r->cost = point.cost;
  const Eigen::MatrixXd projected_up = reduced.Project(point, forward);
  const Eigen::MatrixXd projected_down = reduced.Project(point, backward);
  // How much of the forward difference is in a slope: the rows that are solved with and the changes
  // that all else is made of must be the same, or what is left of the one is taken from the other.
  std::vector<double> of_up(theta.size(), 0.5);
  for (std::size_t j = 0; j < theta.size(); ++j) {
    const auto c = static_cast<Eigen::Index>(j);
    ParameterEstimate& e = r->parameters[j];
    e.value = theta[j];
    const double sum = (projected_up.col(c) + projected_down.col(c)).norm();
    e.kink = sum > 0.0 ? (projected_up.col(c) - projected_down.col(c)).norm() / sum : 0.0;
    // At a kink the flatter side bounds what the data say.
    if (e.kink > kKink) {
      const bool up_is_flatter = projected_up.col(c).norm() < projected_down.col(c).norm();
      of_up[j] = up_is_flatter ? 1.0 : 0.0;
      r->sensitivity.col(c) = up_is_flatter ? forward.col(c) : backward.col(c);
    }
    r->sensitivity.col(c) /= Slope(problem.parameters[j], e.value);
  }
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    TrialResult& trial = r->trials[t];
    trial.prediction = *point.prediction[t];
    trial.registration = point.registration[t];
    trial.at = trial.registration.at;
    trial.reference = reduced.parts()[t].reference;
    trial.change.clear();
    for (std::size_t j = 0; j < theta.size(); ++j) {
      const double slope = Slope(problem.parameters[j], theta[j]);
      trial.change.push_back(
          Sum(Scaled(up[t][j], of_up[j] / slope), (1.0 - of_up[j]) / slope, down[t][j]));
    }
  }
  beside.erase(beside.begin(), beside.begin() + static_cast<std::ptrdiff_t>(ladder));
  for (const Evaluator::Request& request : beside) {
    const Evaluator::Answer finer = runner.evaluator().Evaluate({request}).front();
    TrialResult& trial = r->trials[request.trial];
    if (finer->status != ModelStatus::kGood) {
      trial.error_check_failure = finer->message;
      continue;
    }
    const bool mesh = request.fidelity == Fidelity::kFiner;
    const double factor = mesh ? problem.trials[request.trial].finer_factor : 1.0;
    trial.error_check = mesh ? ErrorCheck::kFiner : ErrorCheck::kTolerance;
    trial.model_error =
        Difference(*problem.trials[request.trial].observations, trial.prediction, *finer, factor);
  }
  return true;
}

}  // namespace unfurl::correlate
