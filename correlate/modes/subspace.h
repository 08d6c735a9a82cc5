#pragma once

#include <complex>
#include <vector>

#include "correlate/modes/lag_covariances.h"

namespace unfurl::correlate {

/// A pole of one order, with what it takes to know how it follows from the covariances.
struct SubspacePole {
  int order = 0;
  std::complex<double> pole;     ///< s, Im > 0 [1/s]
  Eigen::VectorXcd shape;        ///< l, in units of the scaled signals; largest entry 1 [-]
  Eigen::VectorXcd right, left;  ///< eigenvectors of the order's matrix, left^H right = 1 [-]
  Eigen::VectorXcd
      control;  ///< r: the pole's part of R_k is Re-twice shape control^T exp(k step s)
};

/// Covariance-driven stochastic subspace identification [Peeters and De Roeck 1999]: the block
/// Hankel matrix of R_1, R_2, .. has the free decays of the structure as its column space, whatever
/// white noise drives it. Poles of all even orders from one singular value decomposition, and by
/// first-order perturbation how poles and shapes follow each block's covariances [Reynders,
/// Pintelon and De Roeck 2008; Doehler and Mevel 2013].
class Subspace {
 public:
  /// `rows` block rows and as many block columns: lags up to 2 rows - 1 must be there.
  Subspace(const LagCovariances& covariances, Eigen::Index l, Eigen::Index rows, double step);

  /// Largest order that can be asked for.
  Eigen::Index most() const;
  /// Those that vibrate (Im > 0), by rising frequency.
  std::vector<SubspacePole> Poles(Eigen::Index order) const;
  /// First-order change of the pole [1/s] with each block's covariances.
  Eigen::VectorXcd Influence(const SubspacePole& p) const;
  /// The same of its shape, l x blocks.
  Eigen::MatrixXcd ShapeInfluence(const SubspacePole& p) const;
  /// Of `control`, in a block alone (not a change): r x blocks, at the pole and shape as they are.
  Eigen::MatrixXcd ControlOfBlocks(const SubspacePole& p) const;

 private:
  struct Realisation {
    Eigen::MatrixXd A, up, down, inverse;  // inverse of up^T up
  };
  Realisation Realise(Eigen::Index order) const;
  // The change with each block of  left^T dA right + of_rows^T dO right.
  Eigen::VectorXcd Functional(const Realisation& at, std::complex<double> z,
                              const Eigen::VectorXcd& right, const Eigen::VectorXcd& left,
                              const Eigen::VectorXcd& of_rows) const;

  const LagCovariances& covariances_;
  const Eigen::Index l_, r_, rows_;
  const double step_;
  Eigen::MatrixXd U_, V_;
  Eigen::VectorXd s_;
};

}  // namespace unfurl::correlate
