#pragma once

#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

/// One sample that sticks out.
struct GrossSample {
  std::size_t mark = 0, index = 0;  ///< into Observations::marks and its samples
  double t = 0.0;                   ///< on the record's clock [s]
  double sigmas = 0.0;              ///< how far it lies from its neighbours' residuals [-]
};

/// Gross errors among the samples of one trial.
struct GrossErrors {
  std::vector<GrossSample> samples;  ///< by mark, then time; empty: there are none
  double widening = 1.0;             ///< RMS of a coordinate of theirs, in the samples' sigmas [-]
  double clean = 1.0;                ///< the same of all others [-]
  /// There are samples that stick out, but they come together or are more than a fifth of all: that
  /// is motion which the model lacks, or a disturbance, and nothing is put aside.
  std::size_t in_bursts = 0;
  std::vector<GrossSample> suspects;  ///< those
};

/// Looks for gross errors in residuals (3 a sample, in the samples' sigmas, no whitening in time;
/// 0: unknown). Each is taken against the median of the three before and the three after it, so
/// that a model which is wrong in a smooth way, or a fit that the errors have bent, does not count.
/// Whether there are any is decided by the data: a mixture of two normal densities [McLachlan and
/// Peel 2000] against one, by the Bayesian information criterion. A sample is gross where the wider
/// density is the likelier; densities less than three times as wide as each other cannot be told
/// apart.
GrossErrors FindGrossErrors(const Observations& observations, const Eigen::VectorXd& residual);

/// Widens the covariances of the gross samples, and of suspects, to what they are.
void PutAside(const GrossErrors& gross, Observations* observations);

}  // namespace unfurl::correlate
