#include "correlate/fit/fit_stated.h"

#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "correlate/fit/goodness.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

// At a bound the residual is the bound's doing.
bool AtBound(const Parameter& q, double value) {
  return std::min(value - q.low, q.high - value) <= 1e-9 * std::abs(value);
}

// What a trial and a parameter state, and the residuals of all rows.
std::vector<Stated> Gather(const FitProblem& problem, const std::vector<const Observations*>& data,
                           const FitOptions& options, const StackedRows& rows,
                           const FitResult& result, Eigen::VectorXd* residual) {
  std::vector<Stated> out;
  *residual = Eigen::VectorXd::Zero(rows.A.rows());
  RegistrationOptions all = options.align.registration;
  all.with_others = true;
  for (std::size_t t = 0; t < data.size(); ++t) {
    const StackedRows::Block& b = rows.blocks[t];
    const TrialResult& trial = result.trials[t];
    residual->segment(b.row, b.rows) = trial.residual;
    for (Stated& s :
         StatedOf(*data[t], problem.trials[t].observations->placement, trial.registration, all)) {
      s.trial = static_cast<int>(t);
      s.row += b.row;
      out.push_back(std::move(s));
    }
  }
  Eigen::Index row = rows.first_prior;
  for (std::size_t j = 0; j < problem.parameters.size(); ++j) {
    const Parameter& q = problem.parameters[j];
    if (!q.has_prior) continue;
    Stated s;
    s.name = q.name, s.unit = q.unit, s.parameter = true;
    s.mean = q.prior_mean, s.sigma = q.prior_sigma, s.value = result.parameters[j].value;
    s.row = row++;
    (*residual)(s.row) = (s.value - s.mean) / s.sigma;
    if (!AtBound(q, s.value)) out.push_back(std::move(s));
  }
  return out;
}

// A^T G A with the noise G that these residuals show.
Eigen::MatrixXd MiddleOf(const std::vector<const Observations*>& data, const StackedRows& rows,
                         const Eigen::VectorXd& residual) {
  const Eigen::MatrixXd priors = rows.A.bottomRows(rows.A.rows() - rows.first_prior);
  Eigen::MatrixXd out = priors.transpose() * priors;
  for (std::size_t t = 0; t < data.size(); ++t) {
    const StackedRows::Block& b = rows.blocks[t];
    const Eigen::MatrixXd own = rows.A.middleRows(b.row, b.rows);
    const Eigen::MatrixXd draw = own.bottomRows(data[t]->shared_rank);
    out += EstimateResidualNoise(*data[t], residual.segment(b.row, b.rows)).Middle(own);
    out += RowLayout(*data[t]).IndependentGram(own) + draw.transpose() * draw;
  }
  return out;
}

}  // namespace

std::vector<Stated> StatedOf(const FitProblem& problem,
                             const std::vector<const Observations*>& data,
                             const FitOptions& options, const StackedRows& rows,
                             const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& model,
                             const FitResult& result) {
  Eigen::VectorXd residual;
  std::vector<Stated> out = Gather(problem, data, options, rows, result, &residual);
  // First for what each statement moves, then by the noise that is left without it.
  HoldAgainstData(rows.A, residual, inverse, inverse + model, options.step_tolerance, &out);
  const double level = ChanceOfEach(kGoodnessLevel, static_cast<double>(out.size()));
  for (Stated& s : out) {
    const Eigen::VectorXd without = residual + rows.A * s.shift;
    const Eigen::MatrixXd covariance = inverse * MiddleOf(data, rows, without) * inverse + model;
    std::vector<Stated> one = {s};
    HoldAgainstData(rows.A, residual, inverse, covariance, options.step_tolerance, &one);
    s = std::move(one.front());
    s.contradicted = s.p_value < level;
  }
  return out;
}

Eigen::Index LeaveOutContradicted(const std::vector<Stated>& stated, std::size_t trial,
                                  Eigen::Index first, Eigen::VectorXd* residual,
                                  Eigen::MatrixXd* jacobian) {
  Eigen::Index rows = 0;
  for (const Stated& s : stated) {
    if (!s.contradicted || s.parameter || s.trial != static_cast<int>(trial)) continue;
    residual->segment(s.row - first, s.rows).setZero();
    jacobian->middleRows(s.row - first, s.rows).setZero();
    rows += s.rows;
  }
  return rows;
}

const Stated* RestsOn(const FitResult& result, std::size_t j) {
  const ParameterEstimate& e = result.parameters[j];
  for (const Stated& s : result.stated) {
    if (!s.contradicted) continue;
    const double without = e.value + s.shift(static_cast<Eigen::Index>(j));
    if (without < e.all95.low || without > e.all95.high) return &s;
  }
  return nullptr;
}

}  // namespace unfurl::correlate
