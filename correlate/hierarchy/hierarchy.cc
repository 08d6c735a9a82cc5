#include "correlate/hierarchy/hierarchy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/dense.h"
#include "base/error.h"
#include "base/statistics.h"

namespace unfurl::correlate {

namespace {

void Check(const HierarchyProblem& problem) {
  if (problem.trials.size() < 3) {
    throw Error(fmt::format("the scatter of {} trials", problem.trials.size()), "trials",
                "three are the fewest that tell scatter from one that is unlike the others");
  }
  const Eigen::Index p = problem.trials.front().value.size();
  if (problem.shared.rows() != p || problem.shared.cols() != p || !problem.shared.allFinite() ||
      (!problem.scatters.empty() && problem.scatters.size() != static_cast<std::size_t>(p))) {
    throw Error("the trials' common covariance does not go with their values", "trials",
                fmt::format("give {0} x {0} finite numbers", p));
  }
  for (const TrialEstimate& trial : problem.trials) {
    const bool fits = trial.value.size() == p && trial.covariance.rows() == p &&
                      trial.covariance.cols() == p && trial.value.allFinite() &&
                      trial.covariance.allFinite();
    if (!fits || Eigen::LLT<Eigen::MatrixXd>(trial.covariance).info() != Eigen::Success) {
      throw Error("its values or their covariance are no estimate of the parameters", trial.name,
                  "leave the trial out");
    }
  }
}

std::vector<Eigen::Index> Members(const std::vector<bool>& of, bool kind) {
  std::vector<Eigen::Index> out;
  for (std::size_t j = 0; j < of.size(); ++j) {
    if (of[j] == kind) out.push_back(static_cast<Eigen::Index>(j));
  }
  return out;
}

// Mean with the inverse covariances as weights, and its covariance.
struct Weighted {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  double q = 0.0;  // Cochran's Q about it

  Weighted(const std::vector<TrialEstimate>& trials, const std::vector<Eigen::Index>& of) {
    const auto n = static_cast<Eigen::Index>(of.size());
    const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::MatrixXd> inverse;
    for (const TrialEstimate& t : trials) {
      inverse.emplace_back(Eigen::LLT<Eigen::MatrixXd>(t.covariance(of, of)).solve(one));
      information += inverse.back();
      pull += inverse.back() * t.value(of);
    }
    covariance = Eigen::LLT<Eigen::MatrixXd>(information).solve(one);
    mean = covariance * pull;
    for (std::size_t i = 0; i < trials.size(); ++i) {
      const Eigen::VectorXd off = trials[i].value(of) - mean;
      q += off.dot(inverse[i] * off);
    }
  }
};

}  // namespace

Hierarchy::Hierarchy(const HierarchyProblem& problem)
    : levels_(std::max<Eigen::Index>(2, static_cast<Eigen::Index>(problem.trials.size()))),
      scatters_(problem.scatters),
      trials_(problem.trials),
      shared_(problem.shared) {
  Check(problem);
  const auto p = static_cast<std::size_t>(shared_.rows());
  if (scatters_.empty()) scatters_.assign(p, true);
  parameters_.resize(p);
  TestAlike(problem);
  HoldCommon(problem);
  for (std::size_t j = 0; j < p; ++j) {
    ParameterScatter& out = parameters_[j];
    out.scatters = scatters_[j];
    if (!out.scatters) continue;
    const RandomEffect effect =
        Along(Eigen::VectorXd::Unit(shared_.rows(), static_cast<Eigen::Index>(j)));
    const NormalMixture mean = effect.Mean();
    out.value = effect.Value();
    out.sigma = mean.Sigma();
    out.mean95 = mean.Middle95();
    out.scatter = effect.Scatter();
    out.scatter95 = effect.Scatter95();
    out.visible = effect.Visible();
    out.too_alike = effect.TooAlike();
    out.q = effect.Q(0.0);
    out.alike_p = effect.AlikeP();
    out.next95 = effect.Next().Middle95();
    for (Eigen::Index i = 0; i < effect.trials(); ++i) {
      const NormalMixture own = effect.Effect(i);
      out.estimate.push_back(effect.value()(i));
      out.own.push_back(std::sqrt(effect.variance()(i)));
      out.effect.push_back(own.Mean());
      out.effect95.push_back(own.Middle95());
    }
    out.left_out = LeaveOneOut(effect.value(), effect.variance());
  }
  Combine();
}

// Cochran's Q of all parameters, with the trials' whole covariances; and of each that has one
// value, by itself.
void Hierarchy::TestAlike(const HierarchyProblem& problem) {
  const auto p = static_cast<Eigen::Index>(parameters_.size());
  std::vector<Eigen::Index> all;
  for (Eigen::Index j = 0; j < p; ++j) all.push_back(j);
  q_ = Weighted(problem.trials, all).q;
  freedom_ = static_cast<double>(p) * static_cast<double>(problem.trials.size() - 1);
  alike_p_ = ChiSquareTail(q_, freedom_);
  for (Eigen::Index j : Members(scatters_, false)) {
    ParameterScatter& out = parameters_[static_cast<std::size_t>(j)];
    out.q = Weighted(problem.trials, {j}).q;
    out.alike_p = ChiSquareTail(out.q, static_cast<double>(problem.trials.size() - 1));
  }
}

// Parameters of one value: their weighted mean over the trials. Given it, each trial's other
// parameters move by the regression of its own errors, S = C_sc C_cc^-1, and are known better; what
// the mean's error does to them is common to all trials.
void Hierarchy::HoldCommon(const HierarchyProblem& problem) {
  const auto p = static_cast<Eigen::Index>(parameters_.size());
  const std::vector<Eigen::Index> held = Members(scatters_, false), free = Members(scatters_, true);
  if (held.empty()) return;
  const Weighted mean(problem.trials, held);
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(free.size()),
                                                static_cast<Eigen::Index>(held.size()));
  for (TrialEstimate& trial : trials_) {
    const Eigen::MatrixXd cc = trial.covariance(held, held), sc = trial.covariance(free, held);
    Eigen::MatrixXd S(sc.rows(), sc.cols());  // of no rows where nothing scatters
    if (!free.empty()) S = Eigen::LLT<Eigen::MatrixXd>(cc).solve(sc.transpose()).transpose();
    const Eigen::VectorXd off = trial.value(held) - mean.mean;
    const Eigen::VectorXd moved = trial.value(free) - S * off;
    const Eigen::MatrixXd left = trial.covariance(free, free) - S * sc.transpose();
    trial.value(free) = moved;
    trial.value(held) = mean.mean;
    trial.covariance.setZero();
    trial.covariance(free, free) = 0.5 * (left + left.transpose());
    slope += S / static_cast<double>(trials_.size());
  }
  Eigen::MatrixXd error = Eigen::MatrixXd::Zero(p, p);
  error(held, held) = mean.covariance;
  const Eigen::MatrixXd cross = slope * mean.covariance;
  error(free, held) = cross;
  error(held, free) = cross.transpose();
  error(free, free) = cross * slope.transpose();
  shared_ += error;
  for (std::size_t k = 0; k < held.size(); ++k) {
    const Eigen::Index j = held[k];
    ParameterScatter& out = parameters_[static_cast<std::size_t>(j)];
    out.value = mean.mean(static_cast<Eigen::Index>(k));
    out.sigma = std::sqrt(shared_(j, j));
    out.mean95 = {out.value - kHalf95 * out.sigma, out.value + kHalf95 * out.sigma};
    out.next95 = out.mean95;
    for (const TrialEstimate& trial : problem.trials) {
      out.estimate.push_back(trial.value(j));
      out.own.push_back(std::sqrt(trial.covariance(j, j)));
    }
  }
}

// Correlations of the values, by generalised least squares at the scatters found; and each trial's
// least probability.
void Hierarchy::Combine() {
  const std::vector<Eigen::Index> free = Members(scatters_, true);
  covariance_ = shared_;
  if (!free.empty()) {
    std::vector<TrialEstimate> wide = trials_;
    for (TrialEstimate& trial : wide) {
      for (Eigen::Index j : free) {
        const double tau = parameters_[static_cast<std::size_t>(j)].scatter;
        trial.covariance(j, j) += tau * tau;
      }
    }
    covariance_(free, free) += Weighted(wide, free).covariance;
  }
  const Eigen::VectorXd sigma = covariance_.diagonal().cwiseSqrt();
  for (Eigen::Index j = 0; j < covariance_.rows(); ++j) {
    const double factor = parameters_[static_cast<std::size_t>(j)].sigma / sigma(j);
    covariance_.row(j) *= factor;
    covariance_.col(j) *= factor;
  }
  for (std::size_t i = 0; i < trials_.size(); ++i) {
    double least = 1.0;
    for (Eigen::Index j : free) {
      least = std::min(least, parameters_[static_cast<std::size_t>(j)].left_out[i].p);
    }
    unlike_p_.push_back(std::min(1.0, least * static_cast<double>(free.size())));
  }
}

Interval Hierarchy::NextAlong(const Eigen::VectorXd& direction, double extra_variance) const {
  const double known = std::max(0.0, direction.dot(shared_ * direction)) + extra_variance;
  const bool seen = std::all_of(trials_.begin(), trials_.end(), [&](const TrialEstimate& trial) {
    return direction.dot(trial.covariance * direction) > 0.0;
  });
  if (seen) return Along(direction).NextEstimate(known).Middle95();
  // No scatter: the parameters of one value, the same in all trials.
  const double value = direction.dot(trials_.front().value), half = kHalf95 * std::sqrt(known);
  return {value - half, value + half};
}

RandomEffect Hierarchy::Along(const Eigen::VectorXd& direction) const {
  const auto n = static_cast<Eigen::Index>(trials_.size());
  Eigen::VectorXd value(n), variance(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const TrialEstimate& trial = trials_[static_cast<std::size_t>(i)];
    value(i) = direction.dot(trial.value);
    variance(i) = direction.dot(trial.covariance * direction);
  }
  return {value, variance, std::max(0.0, direction.dot(shared_ * direction)), levels_};
}

}  // namespace unfurl::correlate
