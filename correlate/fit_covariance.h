#pragma once

#include "correlate/fit.h"
#include "correlate/reduced_problem.h"

namespace unfurl::correlate {

// What the estimate is worth: fills in the standard errors, covariance, verdicts and noise of
// `result`, whose prediction, registration, sensitivity (d residual / d value), model_error and
// kinks stand already. `observations` are those of the last stage.
//
// With rows A = [parameters, nuisances] and the priors' rows among them, H = A^T A:
// - white: H^-1;
// - data: H^-1 (A^T G A + P) H^-1, see ResidualNoise;
// - model: the shifts of the unknowns that the model's own error d would cause. d has a known shape
//   only as far as the discretisation error is proportional to the square of the spacing, so it
//   enters twice: as one common direction, delta delta^T, and as independent directions for each
//   mark and section of time, sum_s delta_s delta_s^T, so that no lucky cancellation between
//   early and late, or between marks, is counted on.
void FillCovariance(const FitProblem& problem, const Observations& observations,
                    const FitOptions& options, FitResult* result);

// Verdict and reason of each parameter from its numbers.
void Judge(const FitProblem& problem, const Eigen::MatrixXd& information, FitResult* result);

}  // namespace unfurl::correlate
