#include "correlate/fit/correction.h"

#include <cmath>

#include "correlate/fit/broyden.h"
#include "correlate/residual/change.h"

namespace unfurl::correlate {

Eigen::VectorXd Correction::DifferenceOf(const Observations& o, const Prediction& coarse,
                                         const Prediction& fine) {
  const Change change = correlate::Difference(o, coarse, fine);
  Eigen::Index rows = 6 * static_cast<Eigen::Index>(o.size());
  for (const Eigen::VectorXd& kind : change.others) rows += kind.size();
  Eigen::VectorXd out(rows);
  Eigen::Index row = 0;
  for (std::size_t m = 0; m < coarse.marks.size(); ++m) {
    const Eigen::Index n = coarse.marks[m].p.cols();
    Eigen::Map<Eigen::Matrix3Xd>(out.data() + row, 3, n) = change.marks[m];
    row += 3 * n;
    Eigen::Map<Eigen::Matrix3Xd>(out.data() + row, 3, n) = fine.marks[m].v - coarse.marks[m].v;
    row += 3 * n;
  }
  for (const Eigen::VectorXd& kind : change.others) {
    out.segment(row, kind.size()) = kind;
    row += kind.size();
  }
  return out;
}

Correction::Correction(const std::vector<Parameter>& parameters,
                       std::vector<const Observations*> observations, Eigen::VectorXd u,
                       Difference difference)
    : parameters_(parameters),
      observations_(std::move(observations)),
      u_(std::move(u)),
      difference_(std::move(difference)) {}

Eigen::VectorXd Correction::At(std::size_t trial, const Eigen::VectorXd& u) const {
  Eigen::VectorXd out = difference_[trial];
  if (has_slope()) out.noalias() += slope_[trial] * ValueSteps(parameters_, u_, u);
  return out;
}

void Correction::Learn(const Eigen::VectorXd& u, const Difference& difference,
                       const Eigen::VectorXd& sigma) {
  Eigen::VectorXd here = sigma;  // of steps from the centre
  for (Eigen::Index j = 0; j < u.size(); ++j) {
    if (parameters_[static_cast<std::size_t>(j)].log) here(j) *= std::exp(u(j) - u_(j));
  }
  const Eigen::VectorXd weights = BroydenWeights(ValueSteps(parameters_, u_, u), here);
  if (weights.size() == 0) return;
  if (!has_slope()) {
    for (const Eigen::VectorXd& d : difference_) {
      slope_.push_back(Eigen::MatrixXd::Zero(d.size(), u_.size()));
    }
  }
  for (std::size_t t = 0; t < difference_.size(); ++t) {
    const Eigen::VectorXd missing = difference[t] - At(t, u);
    slope_[t].noalias() += missing * weights.transpose();
  }
}

void Correction::MoveTo(const Eigen::VectorXd& u, Difference difference) {
  for (Eigen::Index j = 0; has_slope() && j < u.size(); ++j) {
    if (!parameters_[static_cast<std::size_t>(j)].log) continue;
    for (Eigen::MatrixXd& slope : slope_) slope.col(j) *= std::exp(u(j) - u_(j));
  }
  u_ = u;
  difference_ = std::move(difference);
}

Prediction Correction::Apply(std::size_t trial, const std::vector<double>& theta,
                             const Prediction& coarse) const {
  Eigen::VectorXd u(u_.size());
  for (Eigen::Index j = 0; j < u.size(); ++j) {
    const auto i = static_cast<std::size_t>(j);
    u(j) = ToInternal(parameters_[i], theta[i]);
  }
  const Eigen::VectorXd add = At(trial, u);
  Prediction out = coarse;
  Eigen::Index row = 0;
  for (MarkMotion& motion : out.marks) {
    const Eigen::Index n = motion.p.cols();
    motion.p += Eigen::Map<const Eigen::Matrix3Xd>(add.data() + row, 3, n);
    row += 3 * n;
    motion.v += Eigen::Map<const Eigen::Matrix3Xd>(add.data() + row, 3, n);
    row += 3 * n;
  }
  for (const auto& kind : observations_[trial]->others) {
    const Eigen::Index n = kind->NumbersOf(coarse).size();
    kind->Add(add.segment(row, n), &out);
    row += n;
  }
  return out;
}

}  // namespace unfurl::correlate
