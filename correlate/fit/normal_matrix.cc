#include "correlate/fit/normal_matrix.h"

#include "base/dense.h"

namespace unfurl::correlate {

Eigen::MatrixXd Gram(const Eigen::MatrixXd& A) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(A.cols(), A.cols());
  if (A.size() > 0) H.selfadjointView<Eigen::Lower>().rankUpdate(A.transpose());
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  return H;
}

Eigen::MatrixXd InverseOfNormal(const Eigen::MatrixXd& normal, Eigen::MatrixXd* open) {
  // Of an eigenvalue of the unit-diagonal form. Derivatives by differences are good to some 1e-6,
  // so that a direction's information is known to the square of that.
  constexpr double kFloor = 1e-12;
  const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd unit = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit);
  const Eigen::MatrixXd V = scale.asDiagonal() * eigen.eigenvectors();
  Eigen::VectorXd known = eigen.eigenvalues(), unknown = known;
  for (Eigen::Index i = 0; i < known.size(); ++i) {
    unknown(i) = known(i) < kFloor ? 1.0 / kFloor : 0.0;
    known(i) = known(i) < kFloor ? 0.0 : 1.0 / known(i);
  }
  *open = V * unknown.asDiagonal() * V.transpose();
  return V * known.asDiagonal() * V.transpose();
}

StackedRows StackRows(const Eigen::MatrixXd& sensitivity,
                      const std::vector<Eigen::MatrixXd>& jacobian) {
  StackedRows out;
  const Eigen::Index p = sensitivity.cols();
  Eigen::Index columns = p;
  for (const Eigen::MatrixXd& N : jacobian) {
    out.blocks.push_back({out.first_prior, N.rows(), columns, N.cols()});
    out.first_prior += N.rows();
    columns += N.cols();
  }
  out.A = Eigen::MatrixXd::Zero(sensitivity.rows(), columns);
  out.A.leftCols(p) = sensitivity;
  for (std::size_t t = 0; t < jacobian.size(); ++t) {
    const StackedRows::Block& b = out.blocks[t];
    out.A.block(b.row, b.column, b.rows, b.columns) = jacobian[t];
  }
  return out;
}

}  // namespace unfurl::correlate
