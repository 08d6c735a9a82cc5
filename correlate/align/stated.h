#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "correlate/align/registration.h"

namespace unfurl::correlate {

/// Something that was stated beforehand by a normal density, a prior, held against what the data
/// say without it.
struct Stated {
  std::string name;  ///< "time offset", "frame", "gain of encoder"; of a fit also a parameter's
  std::string unit;  ///< "s"
  bool parameter = false;  ///< of a model, not of a trial
  int trial = 0;           ///< of a fit
  /// As stated [unit]; NaN of a frame, which has six numbers.
  double mean = std::numeric_limits<double>::quiet_NaN();
  double sigma = std::numeric_limits<double>::quiet_NaN();    ///< likewise
  double value = std::numeric_limits<double>::quiet_NaN();    ///< with the data [unit]
  double without = std::numeric_limits<double>::quiet_NaN();  ///< about, by the data alone [unit]
  Eigen::Index row = 0, rows = 1;                             ///< where its residual rows stand
  double p_value = 1.0;       ///< that the two lie so far apart by chance [-]
  bool contradicted = false;  ///< all that was stated together, at `kGoodnessLevel`
  Eigen::VectorXd shift;      ///< about, of every unknown, were it not stated [theirs]
};

/// What is stated of a registration: of frame, offset and drift by `placement` (the one that a
/// person gave), and of the residual kinds' unknowns. Rows are those of the registration.
std::vector<Stated> StatedOf(const Observations& observations, const Placement& placement,
                             const RegistrationFit& fit, const RegistrationOptions& options);

/// Fills in what the tests find. Rows `A` (d residual / d unknown) and `residual` at the estimate,
/// `inverse` of the normal matrix A^T A, `covariance` of the unknowns as it is claimed, all of
/// which the search knows to `tolerance` standard errors [-]. The residual rows r = r_0 + A_s e of
/// what is stated, e the estimate's error, have the covariance  1 - 2 A_s H^-1 A_s^T + A_s C A_s^T
/// where the statement is true.
void HoldAgainstData(const Eigen::MatrixXd& A, const Eigen::VectorXd& residual,
                     const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& covariance,
                     double tolerance, std::vector<Stated>* stated);

/// That it contradicts the data, in a sentence; `of` names the trial (" of A"), or is empty.
std::string ContradictionWords(const Stated& stated, const std::string& of);

}  // namespace unfurl::correlate
