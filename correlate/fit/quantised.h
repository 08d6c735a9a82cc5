#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "base/random.h"
#include "correlate/fit/series_noise.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// Residuals of readings whose resolution is coarse beside their noise. What such readings are off
/// by is no noise: it follows from where the motion lies between two steps of the instrument. It is
/// alike where the motion repeats itself and uneven in time, and no model of noise has it. It can
/// be drawn: the model's own motion, moved by up to a step, read again.
class QuantisedRows {
 public:
  /// `residual` of a trial in the samples' sigmas, its derivatives by parameters and nuisances. Of
  /// rows that are not coarse nothing is kept.
  QuantisedRows(const Observations& observations, const Eigen::VectorXd& residual,
                const Eigen::Ref<const Eigen::MatrixXd>& parameters,
                const Eigen::Ref<const Eigen::MatrixXd>& nuisances);
  /// Whether any readings are so: what noise there is beside the steps is less than half of one.
  /// More of it makes what the steps do white.
  bool any() const { return !rows_.empty(); }
  /// Whether a row is one.
  bool Holds(Eigen::Index row) const { return std::binary_search(rows_.begin(), rows_.end(), row); }
  /// Whether all series are.
  bool all() const { return any() && all_; }

  /// What these readings would be off by, had the motion been another by up to half a step of each
  /// unknown, in the samples' sigmas; in place, the other rows stay as they are.
  void Draw(Rng* rng, Eigen::VectorXd* residual) const;

  /// In place of  columns^T G columns  for noise of covariance G of these rows: the mean over draws
  /// e of  (columns^T W e) (columns^T W e)^T.  `whitened`: W columns.
  Eigen::MatrixXd Middle(const Eigen::MatrixXd& whitened, const RowWhitening* whitening) const;

  /// P-values of questions that are put to residuals, by how often a draw does worse.
  struct PValues {
    double white = 1.0, found = 1.0, steady = 1.0;  ///< see GoodnessOfFit [-]
  };
  /// Of all rows as they are, and whitened; for a trial all of whose series are quantised.
  PValues Ask(const Observations& observations, const RowWhitening* whitening, int sections) const;

 private:
  // What noise must be beside the steps for the residuals to be as large as they are, in steps.
  double NoiseBeside(const Eigen::VectorXd& residual) const;
  // Of these rows, what is left with the unknowns fitted.
  Eigen::VectorXd Fitted(const Eigen::VectorXd& own) const;

  Eigen::VectorXd residual_;        // all rows
  std::vector<Eigen::Index> rows_;  // ascending
  Eigen::VectorXd step_;            // of each of them, in sigmas
  Eigen::MatrixXd moves_;           // columns of them, each half a step at most
  Eigen::MatrixXd basis_;           // orthonormal, of the columns
  double noise_ = 0.0;              // beside the steps, in steps
  bool all_ = true;
};

}  // namespace unfurl::correlate
