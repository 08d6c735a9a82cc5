#pragma once

#include <Eigen/Core>
#include <vector>

namespace unfurl::correlate {

/// A^T A.
Eigen::MatrixXd Gram(const Eigen::MatrixXd& A);

/// Inverse of a normal matrix in unit-diagonal form. Directions without information are left out of
/// it, and get a large but finite variance of their own in `open`, so that what depends on them is
/// seen to be unknown.
Eigen::MatrixXd InverseOfNormal(const Eigen::MatrixXd& normal, Eigen::MatrixXd* open);

/// Whitened rows of several trials, and behind them those of the parameters' priors, by
/// [parameters, nuisances of each trial].
struct StackedRows {
  /// Where a trial's rows and nuisance columns stand in the whole.
  struct Block {
    Eigen::Index row = 0, rows = 0, column = 0, columns = 0;
  };
  Eigen::MatrixXd A;             ///< rows x (parameters and nuisances) [1/unit]
  std::vector<Block> blocks;     ///< by trial
  Eigen::Index first_prior = 0;  ///< row
};

/// `sensitivity`: d residual / d parameter, rows of all trials and priors; `jacobian`: d residual /
/// d nuisance, by trial.
StackedRows StackRows(const Eigen::MatrixXd& sensitivity,
                      const std::vector<Eigen::MatrixXd>& jacobian);

}  // namespace unfurl::correlate
