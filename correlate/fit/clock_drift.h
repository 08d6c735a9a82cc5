#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

/// What a clock drift of one trial, of which nothing was said beforehand, would do to a fit that
/// has none.
struct DriftTest {
  bool tested = false;     ///< false: something was said, or the marks do not respond to one
  double drift = 0.0;      ///< by which the record's clock would run fast [-]
  double sigma = 0.0;      ///< its standard error, correlation of the residuals included [-]
  double deviance = 0.0;   ///< (drift / sigma)^2 [-]
  bool called = false;     ///< the data call for it, and it is one that a clock may have
  bool too_large = false;  ///< the data call for it, but no clock is so wrong: the model's time is
};

/// A score test at the estimate: the step in drift that lowers the residuals most, all parameters,
/// frames and offsets free, over its standard error by the noise that it would leave. Called for by
/// the Bayesian information criterion, up to three times `clock_sigma`, what clocks differ by [-].
/// `J` is d residual / d u before projection, known to a part `roughness` (its differences to
/// either side disagree by that): a drift of which less than that is its own is not tested. One
/// result a part of the problem.
std::vector<DriftTest> TestClockDrift(const ReducedProblem& reduced,
                                      const ReducedProblem::Point& point, const Eigen::MatrixXd& J,
                                      const RegistrationOptions& options, double clock_sigma,
                                      double roughness = 0.0);

}  // namespace unfurl::correlate
