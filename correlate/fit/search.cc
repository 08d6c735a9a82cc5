#include "correlate/fit/search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/dense.h"
#include "base/error.h"
#include "base/worker_pool.h"
#include "correlate/align/first_impact.h"
#include "correlate/fit/solver.h"
#include "correlate/residual/row_layout.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

std::size_t FewestOfHorizon(const FitProblem& problem, const FitOptions& options) {
  constexpr std::size_t kEnough = 50;        // whatever is sought
  constexpr std::size_t kOfEachUnknown = 5;  // then four in five are left to contradict it
  std::size_t unknowns = 0;
  for (const FitTrial& trial : problem.trials) {
    RegistrationOptions all = WithPlacement(options.align.registration, *trial.observations);
    all.with_others = true;
    unknowns = std::max(unknowns, Nuisances(all, *trial.observations).size());
  }
  return std::min(kEnough, kOfEachUnknown * (problem.parameters.size() + unknowns));
}

StageRunner::StageRunner(const FitProblem& problem, const FitOptions& options,
                         const Candidate& from, Workers& workers, int start)
    : problem_(problem),
      options_(options),
      from_(from),
      evaluator_(problem, workers, start),
      model_noise_(problem.trials.size(), 0.0) {
  result_.from = from.theta;
  result_.screened = from.misfit;
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    u_.push_back(ToInternal(problem.parameters[j], from.theta[j]));
  }
  for (const Alignment& a : from.alignment) {
    at_.push_back(a.at);
    at_.back().drift = a.drift;
    reference_.push_back(at_.back().clock());
  }
  FindEnds();
}

double StageRunner::HorizonEnd(std::size_t trial, double end) const {
  return end + at_[trial].offset;
}

void StageRunner::Build(const std::vector<const Observations*>& observations,
                        const std::vector<const RowWhitening*>& whitening, bool keep_clocks,
                        int stage) {
  std::vector<ReducedProblem::Part> parts;
  std::vector<Stamps> stamps;
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
    if (!keep_clocks) reference_[t] = at_[t].clock();
    parts.push_back({t, observations[t], reference_[t], at_[t], whitening[t]});
    stamps.push_back(observations[t]->StampsAt(reference_[t]));
  }
  // Stamps that stand keep what was answered at them.
  if (!keep_clocks) evaluator_.SetStamps(std::move(stamps), stage);
  reduced_ =
      std::make_unique<ReducedProblem>(std::move(parts), options_.align.registration, evaluator_);
}

SolverOptions StageRunner::OptionsOfSolver(double tolerance, bool central,
                                           const std::vector<std::string>& free) const {
  SolverOptions solver;
  solver.max_iterations = options_.max_iterations;
  solver.central_from_start = central;
  solver.step_tolerance = tolerance;
  solver.floor = floor_;
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
    solver.difference_target = std::max({solver.difference_target, options_.difference_sigma,
                                         options_.noise_factor * model_noise_[t]});
  }
  for (const Parameter& p : problem_.parameters) {
    solver.held.push_back(!free.empty() &&
                          std::find(free.begin(), free.end(), p.name) == free.end());
  }
  return solver;
}

bool StageRunner::SolveStage(const StageResult& named, const SolverOptions& how) {
  StageResult stage = named;
  if (!steps_.empty()) reduced_->TakeSteps(steps_);
  SolverOptions solver = how;
  solver.slopes = &slopes_;
  if (reduced_->At(u_, &point_, "trial")) {
    for (std::size_t t = 0; t < point_.prediction.size(); ++t) {
      const double sigma = TypicalSigma(*problem_.trials[t].observations);
      const double noise = sigma > 0.0 ? point_.prediction[t]->noise / sigma : 0.0;
      solver.difference_target = std::max(solver.difference_target, options_.noise_factor * noise);
    }
    if (on_best) on_best(point_.cost, Values(problem_.parameters, u_.data()));
  }
  solver.on_iteration = [&](double cost, const std::vector<double>& best) {
    if (on_best && !best.empty()) on_best(cost, Values(problem_.parameters, best.data()));
  };
  const SolverResult solved = Solve(*reduced_, problem_.parameters, u_, solver);
  stage.iterations += solved.iterations;
  stage.solver_message = solved.message;
  stage.cost = solved.cost;
  u_ = solved.u;
  if (solved.sigma.size() > 0) sigma_ = solved.sigma;
  steps_ = reduced_->steps();
  stage.theta = Values(problem_.parameters, u_.data());
  const bool good =
      solved.status != SolverStatus::kStartFailed && reduced_->At(u_, &point_, "trial");
  result_.stages.push_back(stage);
  result_.to = stage.theta;
  message_ = solved.message;
  if (!good) {
    status_ = FitStatus::kModelFailed;
    if (!point_.failure.empty()) message_ += ": " + point_.failure;
    result_.message = message_;
    return false;
  }
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) at_[t] = point_.registration[t].at;
  status_ =
      solved.status == SolverStatus::kConverged ? FitStatus::kConverged : FitStatus::kNotConverged;
  result_.message = message_;
  return true;
}

void StageRunner::FindEnds() {
  ends_ = options_.stages;
  if (options_.stages_by_impacts) {
    ends_.clear();
    constexpr double kFirst = 6.0, kGrowth = 1.6;  // samples beyond the impact; from end to end
    const Observations& o = *problem_.trials.front().observations;
    const double impact = FirstImpact(o) - at_.front().offset;
    const double step = o.ShortestStep();
    const double last = o.End() - at_.front().offset;
    if (std::isfinite(impact)) {
      ends_.push_back(impact - 1.5 * step);
      for (double beyond = kFirst * step; impact + kGrowth * beyond < last; beyond *= kGrowth) {
        ends_.push_back(impact + beyond);
      }
    }
  }
  std::sort(ends_.begin(), ends_.end());
  const std::size_t least = FewestOfHorizon(problem_, options_);
  // Those that hold next to nothing, or all, are none.
  std::erase_if(ends_, [&](double end) {
    std::size_t fewest = std::numeric_limits<std::size_t>::max();
    bool shorter = false;
    for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
      const Observations& all = *problem_.trials[t].observations;
      shorter = shorter || HorizonEnd(t, end) < all.End();
      std::size_t count = 0;
      for (const RowSeries& s : RowLayout(all).series) {
        count += static_cast<std::size_t>(
            std::upper_bound(s.t->begin(), s.t->end(), HorizonEnd(t, end)) - s.t->begin());
      }
      fewest = std::min(fewest, count);
    }
    return !shorter || fewest < least;
  });
  ends_.push_back(std::numeric_limits<double>::infinity());
}

std::size_t StageRunner::BuildStage(std::size_t s) {
  const std::vector<const RowWhitening*> white(problem_.trials.size(), nullptr);
  std::vector<const Observations*> data;
  std::size_t samples = 0;
  cut_.clear();
  for (std::size_t t = 0; t < problem_.trials.size(); ++t) {
    const Observations& all = *problem_.trials[t].observations;
    const double end =
        std::isfinite(ends_[s]) ? HorizonEnd(t, ends_[s]) : std::numeric_limits<double>::infinity();
    cut_.push_back(
        std::make_unique<Observations>(Cut(all, {-std::numeric_limits<double>::infinity(), end})));
    data.push_back(cut_.back().get());
    samples += cut_.back()->readings();
  }
  last_stage_ = static_cast<int>(s);
  slopes_.Forget();
  Build(data, white, false, last_stage_);
  return samples;
}

bool StageRunner::Lead(std::size_t s, int most_iterations) {
  StageResult stage;
  stage.end = ends_[s];
  stage.samples = BuildStage(s);
  const auto& free = options_.free;
  const std::size_t f = std::min(s, free.empty() ? 0 : free.size() - 1);
  SolverOptions how = OptionsOfSolver(kLeadingTolerance, false,
                                      free.empty() ? std::vector<std::string>{} : free[f]);
  how.verify = false;
  how.leads = alone_ && s + 1 == ends_.size();
  if (most_iterations > 0) how.max_iterations = most_iterations;
  if (!SolveStage(stage, how)) return false;
  double rows = 0.0;
  for (const RegistrationFit& r : point_.registration) rows += static_cast<double>(r.data_rows);
  misfit_ = 2.0 * point_.cost / std::max(1.0, rows);
  if (s + 1 == ends_.size()) result_.cost = point_.cost;
  return true;
}

std::vector<std::vector<double>> StageRunner::ScatterOpen(
    const std::vector<std::vector<double>>& hypercube) {
  constexpr double kOpen = 0.1;  // standard error, of the range between the bounds
  const auto p = static_cast<Eigen::Index>(u_.size());
  if (hypercube.empty() || !slopes_.Buy(*reduced_, u_, point_)) return {};
  const Eigen::MatrixXd J = slopes_.Rows(*reduced_);
  Eigen::VectorXd range(p);
  for (Eigen::Index j = 0; j < p; ++j) {
    const Parameter& q = problem_.parameters[static_cast<std::size_t>(j)];
    range(j) = ToInternal(q, q.high) - ToInternal(q, SearchLow(q));
  }
  const Eigen::MatrixXd scaled = reduced_->Project(point_, J) * range.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(scaled.transpose() * scaled));
  Eigen::MatrixXd open = Eigen::MatrixXd::Zero(p, p);
  for (Eigen::Index v = 0; v < p; ++v) {
    const double spread =
        std::sqrt(std::max(1.0, misfit_)) / std::sqrt(std::max(eigen.eigenvalues()(v), 1e-300));
    if (spread > kOpen)
      open += eigen.eigenvectors().col(v) * eigen.eigenvectors().col(v).transpose();
  }
  if (open.norm() == 0.0) return {};
  std::vector<std::vector<double>> out;
  for (const std::vector<double>& theta : hypercube) {
    Eigen::VectorXd away(p);
    for (Eigen::Index j = 0; j < p; ++j) {
      const auto i = static_cast<std::size_t>(j);
      away(j) = (ToInternal(problem_.parameters[i], theta[i]) - u_[i]) / range(j);
    }
    away = open * away;
    std::vector<double> moved(u_.size());
    for (Eigen::Index j = 0; j < p; ++j) {
      const auto i = static_cast<std::size_t>(j);
      moved[i] = FromInternal(problem_.parameters[i], u_[i] + range(j) * away(j));
    }
    out.push_back(std::move(moved));
  }
  return out;
}

std::vector<double> StageRunner::CostsAt(const std::vector<std::vector<double>>& theta,
                                         std::size_t stage) {
  BuildStage(stage);
  std::vector<std::vector<double>> u(theta.size());
  for (std::size_t i = 0; i < theta.size(); ++i) {
    for (std::size_t j = 0; j < theta[i].size(); ++j) {
      u[i].push_back(ToInternal(problem_.parameters[j], theta[i][j]));
    }
  }
  std::vector<ReducedProblem::Point> points;
  const std::vector<bool> good = reduced_->AtAll(u, &points, "screening");
  std::vector<double> costs;
  for (std::size_t i = 0; i < u.size(); ++i) {
    costs.push_back(good[i] ? points[i].cost : std::numeric_limits<double>::infinity());
  }
  return costs;
}

void StageRunner::MoveTo(const std::vector<double>& theta, const StageRunner& from) {
  for (std::size_t j = 0; j < theta.size(); ++j) {
    u_[j] = ToInternal(problem_.parameters[j], theta[j]);
  }
  at_ = from.at_;
  ends_ = from.ends_;
  result_.from = theta;
  result_.stages = from.result_.stages;
}

void StageRunner::Restart(const std::vector<double>& theta) {
  for (std::size_t j = 0; j < theta.size(); ++j) {
    u_[j] = ToInternal(problem_.parameters[j], theta[j]);
  }
  if (!reduced_->At(u_, &point_, "profile")) return;
  for (std::size_t t = 0; t < at_.size(); ++t) at_[t] = point_.registration[t].at;
}

Eigen::VectorXd StageRunner::sigma() const {
  if (floor_.size() != sigma_.size()) return sigma_;
  return (sigma_.cwiseAbs2() + floor_.cwiseAbs2()).cwiseSqrt();
}

bool StageRunner::Settled() const { return reduced_->ClocksHold(point_, at_, misfit_); }

bool StageRunner::Place(const std::vector<const Observations*>& observations,
                        const std::vector<const RowWhitening*>& whitening) {
  // A drift that was fitted before is not one that stays where none is fitted.
  for (std::size_t t = 0; t < at_.size(); ++t) {
    const Placement& known = observations[t]->placement;
    if (WithPlacement(options_.align.registration, *observations[t]).fit_drift) continue;
    at_[t].drift = known.drift.kind == Foreknowledge::kKnown ? known.drift.mean : 0.0;
  }
  const bool settled = Settled();
  Build(observations, whitening, settled, last_stage_);
  if (!steps_.empty()) reduced_->TakeSteps(steps_);
  return settled;
}

bool StageRunner::SolveHere(const std::string& what, double tolerance, bool verify) {
  StageResult stage;
  stage.end = std::numeric_limits<double>::infinity();
  for (const ReducedProblem::Part& part : reduced_->parts()) {
    stage.samples += part.observations->readings();
  }
  SolverOptions how = OptionsOfSolver(
      tolerance, true, options_.free.empty() ? std::vector<std::string>{} : options_.free.back());
  how.verify = verify;
  const bool good = SolveStage(stage, how);
  result_.stages.back().solver_message = what + ": " + result_.stages.back().solver_message;
  return good;
}

bool StageRunner::Sharpen(const std::vector<const Observations*>& observations,
                          const std::vector<const RowWhitening*>& whitening,
                          const std::string& what) {
  // Each starts from the solution of the one before; it ends earlier where that stays.
  constexpr int kMaxRounds = 3;
  for (int round = 0; round < kMaxRounds; ++round) {
    if (round > 0 && Settled()) return true;
    Place(observations, whitening);
    if (!SolveHere(what)) return false;
  }
  return true;
}

}  // namespace unfurl::correlate
