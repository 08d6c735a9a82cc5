#pragma once

#include <Eigen/Core>
#include <vector>

#include "campaign/statistics/chaos.h"

namespace unfurl::campaign {

/// Terms of `dimensions` inputs whose degrees have a norm of at most `degree`, the constant first;
/// empty where there are more than `most`.
std::vector<ChaosTerm> TermsOf(int dimensions, int degree, double truncation, int interaction,
                               std::size_t most);

/// Orthonormal polynomials of degrees 0 .. degree at one u: Legendre's on (0, 1), or Hermite's of
/// the normal score.
void Polynomials(ChaosBasis basis, double u, int degree, double* values);

/// Values of the terms at each point (one a column of `points`): points x terms.
Eigen::MatrixXd TermValues(ChaosBasis basis, const std::vector<ChaosTerm>& terms, int degree,
                           const Eigen::MatrixXd& points);

/// Terms picked one after another by their correlation with what is left, up to the number with
/// the least corrected leave-one-out error.
struct Pursuit {
  std::vector<int> picked;  // columns, in order
  double loo_error = 0.0;   // mean square, uncorrected, of the terms picked
  double criterion = 0.0;   // corrected by n / (n - k) (1 + k / n) [Chapelle, Vapnik, Bengio 2002]
};
Pursuit Pursue(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values);

}  // namespace unfurl::campaign
