#include "correlate/fit/slopes.h"

#include <cmath>
#include <utility>

#include "correlate/fit/broyden.h"
#include "correlate/fit/solver.h"

namespace unfurl::correlate {

void LearnStep(const ReducedProblem& problem, const ReducedProblem::Point& from,
               const ReducedProblem::Point& to, const Eigen::VectorXd& by,
               const Eigen::VectorXd& sigma, ReducedProblem::Changes* change) {
  const Eigen::VectorXd weights = BroydenWeights(by, sigma);
  if (weights.size() == 0) return;
  for (std::size_t i = 0; i < change->size(); ++i) {
    std::vector<Change>& of = (*change)[i];
    Change missing =
        Difference(*problem.parts()[i].observations, *from.prediction[i], *to.prediction[i]);
    for (std::size_t j = 0; j < of.size(); ++j) {
      missing = Sum(missing, -by(static_cast<Eigen::Index>(j)), of[j]);
    }
    for (std::size_t j = 0; j < of.size(); ++j) {
      of[j] = Sum(of[j], weights(static_cast<Eigen::Index>(j)), missing);
    }
  }
}

bool Slopes::Buy(ReducedProblem& problem, const std::vector<double>& u,
                 const ReducedProblem::Point& at, const std::vector<Evaluator::Request>& beside) {
  Eigen::MatrixXd J;
  ReducedProblem::Changes change;
  std::vector<double> kinks;
  if (!problem.CentralSensitivity(u, at, &J, &kinks, beside, &change)) return false;
  kinks_ = std::move(kinks);
  change_ = std::move(change);
  u_ = u;
  at_ = at;
  fresh_ = true;
  mismatch_ = 0.0;
  return true;
}

void Slopes::Take(ReducedProblem::Changes change, const std::vector<double>& u,
                  const ReducedProblem::Point& at) {
  change_ = std::move(change);
  kinks_.clear();
  u_ = u;
  at_ = at;
  fresh_ = false;
  mismatch_ = 0.0;
}

void Slopes::StandAt(const ReducedProblem& problem, const std::vector<double>& u,
                     const ReducedProblem::Point& at) {
  for (std::size_t j = 0; known() && j < u.size(); ++j) {
    if (!problem.parameters()[j].log || u[j] == u_[j]) continue;
    const double factor = std::exp(u[j] - u_[j]);
    for (std::vector<Change>& of : change_) of[j] = Scaled(of[j], factor);
  }
  u_ = u;
  at_ = at;
}

void Slopes::StartAt(const ReducedProblem& problem, const std::vector<double>& u,
                     const ReducedProblem::Point& at) {
  bool same = known() && change_.size() == at.prediction.size();
  for (std::size_t i = 0; same && i < change_.size(); ++i) {
    const std::vector<MarkMotion>& marks = at.prediction[i]->marks;
    for (const Change& of : change_[i]) {
      same = same && of.marks.size() == marks.size();
      for (std::size_t m = 0; same && m < marks.size(); ++m) {
        same = of.marks[m].cols() == marks[m].p.cols();
      }
    }
  }
  if (!same) Forget();
  fresh_ = fresh_ && u == u_;
  StandAt(problem, u, at);
  mismatch_ = 0.0;
}

void Slopes::MoveTo(const ReducedProblem& problem, const std::vector<double>& u,
                    const ReducedProblem::Point& at, double target) {
  Eigen::VectorXd by(static_cast<Eigen::Index>(u.size()));
  for (std::size_t j = 0; j < u.size(); ++j) {
    by(static_cast<Eigen::Index>(j)) = ValueStep(problem.parameters()[j], u_[j], u[j]);
  }
  if (by.isZero(0.0)) return;
  const Eigen::MatrixXd rows = problem.Project(at_, Rows(problem));
  const Eigen::VectorXd actual = at.residual - at_.residual;
  const double rms = actual.norm() / std::sqrt(std::max(1.0, static_cast<double>(actual.size())));
  mismatch_ = 0.0;
  if (rms >= target && rms > 0.0) {
    mismatch_ = (actual - rows * by).norm() / actual.norm();
    LearnStep(problem, at_, at, by, StepAndSigma(rows, at.residual).sigma, &change_);
  }
  StandAt(problem, u, at);
  fresh_ = false;
}

}  // namespace unfurl::correlate
