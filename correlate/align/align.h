#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/align/far_samples.h"
#include "correlate/align/offset.h"
#include "correlate/align/registration.h"
#include "correlate/fit/autocorrelation.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate {

enum class AlignStatus {
  kGood,
  kNothingShared,  // the two records do not show the same motion
  kTooLittle,      // too few samples in common to say
  kNotConverged,
};
const char* Name(AlignStatus status);

/// What must agree before two records count as aligned.
struct AlignOptions {
  OffsetOptions search;
  // Offsets to begin with in place of those that a search finds, of which no correlation is asked
  // [s]; empty: they are searched.
  std::vector<double> at;
  double min_correlation = 0.5;  // of the frame-independent signals at the best offset, (0, 1) [-]
  double min_r2 = 0.5;           // of the aligned positions: below, the records share nothing [-]
  // The same where a single history was correlated (two marks, one body): a frame and an offset
  // make any two smooth openings of one mark look somewhat alike (docs/physics-correlation.md).
  double min_correlation_of_one = 0.8, min_r2_of_one = 0.8;  // [-]
  // The reference ends where it does by choice: what channels show beyond is not held against it.
  bool part = false;
  RegistrationOptions registration;
};

// Time offset and rigid frame of `a` (in W) with respect to `b` (in M).
struct Alignment {
  AlignStatus status = AlignStatus::kTooLittle;
  std::string message;  // in words, with numbers
  /// Frame and offset may be believed.
  bool Usable() const { return status == AlignStatus::kGood; }

  Registration at;
  // By how much the record's clock runs fast [-] and the stamp at which that has no effect [s].
  // With a drift, everything below belongs to the record WithoutDrift(record, drift, pivot), and
  // the offset is that at the pivot.
  double drift = 0.0, drift_pivot = 0.0;
  std::vector<std::string> unknowns;  // of `covariance`, see NuisanceNames
  Eigen::MatrixXd covariance;   // inflated for what the residuals' correlation shows [rad, m, s, -]
  Eigen::VectorXd white_sigma;  // what it would be were the residuals white [rad, m, s]
  double Sigma(const std::string& unknown) const;  // 0 when it was not fitted

  double correlation = 0.0;   // of the coarse signals at the peak [-]
  std::string signal;         // which these were
  double r2 = 0.0;            // share of the marks' motion that the reference explains [-]
  double chi2_per_dof = 0.0;  // of residuals in the marks' own sigmas; 0 without one [-]
  double misfit = 0.0;        // what the reference fails to explain, per coordinate; 0: it fits [m]
  double overlap_start = 0.0, overlap_end = 0.0;  // on a's clock [s]
  std::vector<FarSample> far;  // gross errors that were left out, except of the residuals
  RegistrationFit fit;         // residuals of all samples, and the Jacobian at the solution
  Prediction reference;        // b at the stamps of a
  ResidualNoise noise;
};

// What is known of the record's clock and frame (Observations::placement) is used: a known offset
// is not searched for, and where it places the reference as well as an alignment is asked to,
// neither correlation nor r2 is asked for. Else coarse offset by cross-correlation, then frame and
// offset together by weighted least squares with the covariances of both. `a` holds the marks that
// are to be compared; `b` must hold them too. What cannot be aligned is a status with a message,
// not an error.
Alignment Align(const Observations& a, const SampledModel& b, const AlignOptions& options = {});

// The offsets that an alignment would begin with, the most alike first [s].
std::vector<double> OffsetsAlike(const Observations& a, const SampledModel& b,
                                 const AlignOptions& options = {});

}  // namespace unfurl::correlate
