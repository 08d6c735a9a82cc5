#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "correlate/design/strobe.h"
#include "correlate/fit/fit.h"

namespace unfurl::correlate {

/// A part of what was measured, and what it tells of each parameter, frames, clocks, calibration
/// and the other parameters being unknown.
struct Contribution {
  std::string name;          ///< "mark2", "encoder", "0.5 to 1 s"
  std::size_t readings = 0;  ///< samples of marks, readings of channels, events
  /// By parameter, of the information about it; all parts of one kind and the priors add up to 1
  /// [-].
  std::vector<double> share;
  /// By parameter, the standard error without this part over the one with all; infinity: the
  /// others do not determine it [-].
  std::vector<double> without;
  double from = 0.0, to = 0.0;  ///< of a stretch of time, on its record's clock [s]
};

/// What tells of the parameters of a fit, by several divisions of the same rows.
struct Contributions {
  std::vector<std::string> parameters;  ///< names
  std::vector<double> sigma;            ///< standard error of each, white, all parts [unit]
  std::vector<Contribution> series;     ///< marks, channels, events, by trial
  std::vector<Contribution> times;      ///< stretches of each trial, of equal length
  std::vector<Contribution> lines;      ///< of the strobe's cycle, in the trials that have one
  std::vector<Contribution> cameras;    ///< in the samples of all marks; empty: not asked for
  std::vector<double> priors;           ///< share of what was known beforehand, by parameter [-]
};

/// What each camera of a rig sees of a point, for its share in the marks' samples.
struct CameraSights {
  std::vector<std::string> names;
  /// d reading / d p of a camera at p, in the records' frame [px/m]; zero: it does not see it.
  std::function<Eigen::Vector3d(std::size_t camera, const Eigen::Vector3d& p)> gradient;
};

/// With rows A = [parameters, nuisances] whitened by the fit's noise, H = A^T A and g = H^-1 e_j,
/// the variance of parameter j is (H^-1)_jj = sum over rows (A_i g)^2: each row has its share, and
/// shares of parts add up. `stretches`: in time, of each trial. `fit` must be usable. A sample's
/// information is shared among `cameras` (null: none) as its covariance says.
Contributions ContributionsOf(const FitProblem& problem, const FitResult& fit, int stretches = 8,
                              const CameraSights* cameras = nullptr);

}  // namespace unfurl::correlate
