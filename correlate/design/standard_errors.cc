#include "correlate/design/standard_errors.h"

#include <cmath>
#include <limits>
#include <vector>

#include "base/dense.h"
#include "correlate/fit/normal_matrix.h"

namespace unfurl::correlate {

StandardErrors StandardErrorsOf(const Eigen::MatrixXd& H, Eigen::Index p,
                                const Eigen::MatrixXd* ties) {
  // Unknowns that no row touches: a nuisance of what is not measured costs nothing, a parameter is
  // not determined.
  std::vector<Eigen::Index> used;
  for (Eigen::Index i = 0; i < H.rows(); ++i) {
    if (H(i, i) > 0.0) used.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(used.size());
  Eigen::MatrixXd small(n, n), middle = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const Eigen::Index a = used[static_cast<std::size_t>(i)];
      const Eigen::Index b = used[static_cast<std::size_t>(j)];
      small(i, j) = H(a, b);
      if (ties != nullptr) middle(i, j) = (*ties)(a, b);
    }
  }
  StandardErrors out;
  out.sigma = Eigen::VectorXd::Constant(p, std::numeric_limits<double>::infinity());
  out.inverse = Eigen::MatrixXd::Zero(H.rows(), H.cols());
  if (n == 0) return out;
  Eigen::MatrixXd open;
  Eigen::MatrixXd inverse = InverseOfNormal(small, &open);
  if (ties != nullptr) inverse += inverse * middle * inverse;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      out.inverse(used[static_cast<std::size_t>(i)], used[static_cast<std::size_t>(j)]) =
          inverse(i, j);
    }
    const Eigen::Index k = used[static_cast<std::size_t>(i)];
    // A direction without information that the parameter has a part in.
    if (k < p && open(i, i) <= inverse(i, i)) out.sigma(k) = std::sqrt(inverse(i, i));
  }
  return out;
}

}  // namespace unfurl::correlate
