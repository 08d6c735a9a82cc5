#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace unfurl::calib {

/// What k unknowns add to n misfits: rows from `first`, and zero in all others.
struct Effect {
  Eigen::Index first = 0;
  Eigen::MatrixXd rows;  // m x k [per unit of the unknown]
};

/// Covariance C = D + U U^T of n misfits, where D has a block for each group of neighbours.
struct GroupedCovariance {
  std::vector<Eigen::MatrixXd> own;  // D's blocks, in order, each positive definite [unit^2]
  Eigen::MatrixXd shared;            // U, n x r [unit]

  /// Of each misfit alone, n.
  Eigen::VectorXd Variances() const;
};

/// W with W C W^T = 1, in a time that grows with n and not with its cube [Woodbury; of D = L L^T
/// and L^-1 U = Q S R^T, W = (1 - Q d Q^T) L^-1 with d = 1 - 1 / sqrt(1 + S^2)].
class Whitening {
 public:
  explicit Whitening(const GroupedCovariance& covariance);

  /// n, of misfits.
  Eigen::Index size() const { return static_cast<Eigen::Index>(group_of_.size()); }
  /// W times columns that are given whole (n x k) or in part.
  Eigen::MatrixXd Whiten(const Eigen::Ref<const Eigen::MatrixXd>& columns) const;
  Eigen::MatrixXd Whiten(const Effect& effect) const;
  /// Whether an effect keeps to one group, and is cheap.
  bool IsLocal(const Effect& effect) const;

  /// What may be asked many times of local effects: products with whitened vectors y, and with
  /// orthonormal columns P.
  struct Against {
    const Eigen::VectorXd& y;  // n
    const Eigen::MatrixXd& P;  // n x q
    double square = 0.0;       // of y [-]
    Eigen::VectorXd shared_y;  // Q^T y [-]
    Eigen::MatrixXd shared_P;  // Q^T P [-]
  };
  /// Both are kept by reference.
  Against MakeAgainst(const Eigen::VectorXd& y, const Eigen::MatrixXd& P) const;
  /// What ProductsOf gives.
  struct Products {
    Eigen::MatrixXd gram;   // k x k, E^T E of the whitened effect E beside P: (1 - P P^T) E [-]
    Eigen::VectorXd along;  // E^T y [-]
    double whole = 0.0;     // trace of the gram without P [-]
  };
  /// Of an effect that is local, in a time that does not depend on n. y has nothing along P.
  Products ProductsOf(const Effect& effect, const Against& against) const;

  /// Sum of squares that is left of a whitened y where all of what the effect spans is free, and
  /// how many directions that is.
  struct Rest {
    double square = 0.0;  // [-]
    Eigen::Index freed = 0;
  };
  /// Of one local effect, in a time that does not depend on n.
  Rest WithoutLocal(const Effect& effect, const Against& against) const;
  /// The same of misfits e and many local effects at once, in a time that grows with n.
  Rest WithoutMany(const std::vector<const Effect*>& effects, const Eigen::VectorXd& e) const;

 private:
  struct Group {
    Eigen::Index first = 0;
    Eigen::MatrixXd root;  // L of this block of D [unit]
  };
  // L^-1 of an effect, as rows of its whole group.
  Eigen::MatrixXd Own(const Group& group, const Effect& effect) const;

  std::vector<Group> groups_;
  std::vector<std::size_t> group_of_;  // of each misfit
  Eigen::MatrixXd shared_;             // L^-1 U, n x r [-]
  Eigen::MatrixXd basis_;              // Q, n x min(n, r) [-]
  Eigen::VectorXd drop_;               // d [-]
};

/// Orthonormal columns of what the columns of W span.
Eigen::MatrixXd SpanOf(const Eigen::MatrixXd& W);

}  // namespace unfurl::calib
