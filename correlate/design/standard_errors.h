#pragma once

#include <Eigen/Core>

namespace unfurl::correlate {

/// What a normal matrix leaves open of its first unknowns.
struct StandardErrors {
  Eigen::VectorXd sigma;    ///< of the first unknowns; infinity: not determined [unit]
  Eigen::MatrixXd inverse;  ///< of all; rows and columns of what has no information are zero
};

/// Of the first `p` unknowns of H = A^T A, all others being unknown too. `ties`: A^T C A of rows
/// whose errors are not independent, C being their correlation matrix less the identity, to be
/// added in the middle of H^-1 (H + ties) H^-1; null: none.
StandardErrors StandardErrorsOf(const Eigen::MatrixXd& H, Eigen::Index p,
                                const Eigen::MatrixXd* ties = nullptr);

}  // namespace unfurl::correlate
