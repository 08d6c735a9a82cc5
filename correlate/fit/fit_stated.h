#pragma once

#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/normal_matrix.h"

namespace unfurl::correlate {

/// All that a study states beforehand, of every trial and of parameters that are not at a bound,
/// held against the data (HoldAgainstData), by the noise that each leaves where it is not stated:
/// what is wrong makes a pattern that looks like noise with a memory. `rows` before whitening in
/// time and `inverse` of their normal matrix, `model` the part of the covariance of all unknowns
/// that is the model's own error.
std::vector<Stated> StatedOf(const FitProblem& problem,
                             const std::vector<const Observations*>& data,
                             const FitOptions& options, const StackedRows& rows,
                             const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& model,
                             const FitResult& result);

/// Sets the rows of a trial whose statement the data contradict to 0, as if it had not been made:
/// it is told by name, and neither noise nor the model's fault. `first`: the trial's first row of
/// all. Returns how many rows.
Eigen::Index LeaveOutContradicted(const std::vector<Stated>& stated, std::size_t trial,
                                  Eigen::Index first, Eigen::VectorXd* residual,
                                  Eigen::MatrixXd* jacobian);

/// Of what the data contradict, that which moves parameter j out of its 95% interval: it is known
/// only if the statement holds. Null: none does.
const Stated* RestsOn(const FitResult& result, std::size_t j);

}  // namespace unfurl::correlate
