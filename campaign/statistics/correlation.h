#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

namespace unfurl::campaign {

/// A Gaussian copula: joins inputs of any distributions by the correlation of their standard
/// normal scores z = Phi^-1(u) [Nelsen 2006]. That is the inputs' own correlation where they are
/// normal, and that of their logarithms where they are log-normal; of others, Spearman's rank
/// correlation is what stays: 6 / pi asin(rho / 2), within 0.018 of rho.
class Correlation {
 public:
  Correlation() = default;  // none: Apply changes nothing
  /// `scores`: symmetric, ones on its diagonal, positive definite; otherwise throws Error that
  /// names the pair, or the inputs whose combination the matrix gives no scatter. `names` for it.
  explicit Correlation(const Eigen::MatrixXd& scores, const std::vector<std::string>& names = {});

  /// Independent uniform numbers to correlated ones, in place; those of inputs without a
  /// correlation keep their bits. Stays strictly inside (0, 1).
  void Apply(std::span<double> u) const;
  bool none() const { return joined_.empty(); }

 private:
  std::vector<int> joined_;  // inputs that are correlated with another, ascending
  Eigen::MatrixXd factor_;   // Cholesky's lower factor of theirs
};

/// Spearman's rank correlation of two inputs whose normal scores have correlation `rho`.
double SpearmanOfScores(double rho);

}  // namespace unfurl::campaign
