#pragma once

#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/ladder_error.h"
#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

// What the estimate is worth: fills in the standard errors, covariance, bands and noise of
// `result`, whose predictions, registrations, sensitivity (d residual / d value), model_error and
// kinks stand already. `data` and `whitening` are those of the last stage, by trial.
//
// With rows A = [parameters, nuisances of every trial], whitened by the noise found in the
// residuals, and the priors' rows among them, H = A^T A:
// - white: H^-1 of the rows before whitening in time;
// - data: H^-1 (A^T G A + P) H^-1, G what correlation the whitened residuals still have, see
//   ResidualNoise; trials of one calibration share the rows of its draw;
// - model: the shifts of the unknowns that the model's own error d would cause. d has a known shape
//   only as far as the discretisation error is proportional to the square of the spacing, so it
//   enters twice: as one common direction, delta delta^T, and as independent directions for each
//   trial, mark and section of time, sum_s delta_s delta_s^T, so that no lucky cancellation between
//   early and late, or between marks, is counted on.
//
// - doubt: what not knowing the noise adds to the data's (correlate/fit/noise_doubt.h), which takes
//   longest and hangs on nothing that the model's own error changes: found where `doubt` is empty,
//   and kept there.
//
// The common direction is to first order, or along the ways that are given.
void FillCovariance(const FitProblem& problem, const std::vector<const Observations*>& data,
                    const std::vector<const RowWhitening*>& whitening, const FitOptions& options,
                    FitResult* result, Eigen::MatrixXd* doubt, const WaysOfError& ways = {});

// Profiles of all parameters, and sigma_alone, of a model that scatters by `noise`, by trial, RMS
// in sigmas of the data.
void FillProfiles(const FitProblem& problem, ReducedProblem& reduced, const std::vector<double>& u,
                  const ReducedProblem::Point& point, const FitOptions& options,
                  const std::vector<double>& noise, FitResult* result);

}  // namespace unfurl::correlate
