#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/pose.h"
#include "correlate/fit/series_noise.h"
#include "correlate/model.h"
#include "correlate/observations.h"
#include "correlate/residual/change.h"

namespace unfurl::correlate {

// How a record sits against a model, apart from the model's own parameters: the rigid frame, the
// time offset, and the calibration's one draw z that all samples share.
struct Registration {
  Pose X_WM = Pose::Identity();  // from the model's frame M to the record's frame W
  double offset = 0.0;           // what the record's clock shows when the model's shows 0 [s]
  double drift = 0.0;            // by which the record's clock runs fast, about its pivot [-]
  Eigen::VectorXd own;           // unknowns of the residual kinds, in their order [theirs]
  Eigen::VectorXd z;             // k, prior N(0, I) [-]
  /// The record's clock.
  Clock clock() const { return {offset, drift}; }
};

/// What of a registration is fitted, where nothing is said of it beforehand.
struct RegistrationOptions {
  bool fit_frame = true;
  bool fit_offset = true;
  bool fit_drift = false;
  bool with_others = false;  // of the observations' residual kinds; off: their rows are zeros
  int max_iterations = 30;
  double tolerance = 1e-5;  // ends when no unknown moves by more than this part of its sigma [-]
};

/// The same with what is known of a record beforehand: what is known is not fitted, what has a
/// prior or is said to be free is. A record without marks has no frame.
RegistrationOptions WithPlacement(RegistrationOptions options, const Observations& observations);

// Nuisance unknowns in the order of the columns below: rotation w (3, X_WM <- Exp(w) about the
// centroid of the predicted marks) [rad], shift of that centroid in W (3) [m], offset [s], drift
// [-], those of the residual kinds, z (k). Those that are not fitted have no column. What is known
// of the record beforehand is not looked at: see WithPlacement.
std::vector<std::string> NuisanceNames(const RegistrationOptions& options,
                                       const Observations& observations);

// Where the unknowns of the residual kinds begin.
Eigen::VectorXd StartOfOwn(const Observations& observations);

// Weighted least squares of  p_i = X_WM y(t_i - offset) + F_i z + random_i  by Gauss-Newton, with
// the priors on z and on what is known of the record (Observations::placement). Rows: 3 per sample
// in the order of the observations, whitened by the sample's covariance (and the reference's own,
// where it is a measurement), then those of the residual kinds, then those of the normal priors of
// frame (rotation, shift of the model's origin), offset and drift, then the k rows of the prior on
// z (RowLayout). Samples at which the model has no answer have rows of zeros.
struct RegistrationFit {
  Registration at;
  Eigen::Vector3d centroid_M = Eigen::Vector3d::Zero();  // about which w turns [m]
  Eigen::VectorXd residual;                              // whitened, at the solution [-]
  Eigen::MatrixXd jacobian;    // rows x nuisances: d residual / d unknown [1/rad, 1/m, 1/s, -]
  Eigen::VectorXd sigma;       // of the nuisances, for unit white residuals [rad, m, s, -]
  std::size_t known = 0;       // samples of marks that took part
  Eigen::Index data_rows = 0;  // rows of all series that took part, those of the marks included
  bool converged = false;
  std::vector<std::string> weak;  // directions that the data do not determine, by name

  double SumOfSquares() const { return residual.squaredNorm(); }  // twice the cost
};

// `prediction` must be for observations.StampsAt(reference); away from it offset and drift act
// through the predicted velocities, so a caller iterates until the clocks agree. What is known
// beforehand is taken from the placement, whatever `start` says. With
// `whitening`, rows are its innovations: generalised least squares for correlated noise.
RegistrationFit FitRegistration(const Observations& observations, const Prediction& prediction,
                                const Clock& reference, const Registration& start,
                                const RegistrationOptions& options = {},
                                const RowWhitening* whitening = nullptr);

// A start for the frame from the marks alone (Kabsch, weighted), or from what is known of it.
Registration StartingFrame(const Observations& observations, const Prediction& prediction,
                           double offset);

// Whitened model sensitivities: rows as above, column j is d residual / d parameter j for a change
// `change[j]` of the prediction per unit of the parameter, with the registration `at`.
Eigen::MatrixXd WhitenedSensitivity(const Observations& observations, const Prediction& prediction,
                                    const Clock& reference, const Registration& at,
                                    const std::vector<Change>& change);

// How the clocks lie, for the residual kinds.
ResidualKind::Clocks ClocksOf(const Observations& observations, const Clock& reference,
                              const Clock& at);

// Residuals p - X_WM y(t) - F z in metres in the model's frame, per mark 3 x n; unknown: 0.
std::vector<Eigen::Matrix3Xd> ResidualsInModelFrame(const Observations& observations,
                                                    const Prediction& prediction,
                                                    const Clock& reference, const Registration& at);

// By how much a registration's clock at stamp `t` is ahead of the one that a prediction was made
// for: the model's answer for it is p - Ahead(..) v [s].
inline double Ahead(double t, double pivot, const Clock& reference, const Clock& at) {
  return reference.ModelTime(t, pivot) - at.ModelTime(t, pivot);
}

}  // namespace unfurl::correlate
