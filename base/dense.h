#pragma once

// Eigen's dense solvers and products of double matrices of any size, compiled once, in dense.cc,
// and not in every file that uses them: a file with a singular value decomposition took 30 s to
// compile, and takes 9. A file that is compiled for wider vectors than the rest (unfurl_native in
// CMake) must not include this: its products are other ones under the same names.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace unfurl {
/// What Eigen compiles its product of two double matrices for.
using DenseKernel = Eigen::internal::gebp_traits<double, double>;
/// A matrix operand of such a product, stored by columns or by rows.
template <int kOrder>
using DenseOperand = Eigen::internal::const_blas_data_mapper<double, Eigen::Index, kOrder>;
}  // namespace unfurl

#define UNFURL_DENSE_PRODUCT(HOW, LEFT, RIGHT)                        \
  HOW template struct Eigen::internal::general_matrix_matrix_product< \
      Eigen::Index, double, Eigen::LEFT, false, double, Eigen::RIGHT, false, Eigen::ColMajor, 1>;

// NOLINTBEGIN(bugprone-macro-parentheses): template arguments and a keyword take none
#define UNFURL_DENSE_PACK(HOW, ORDER)                                                          \
  HOW template struct Eigen::internal::gemm_pack_lhs<                                          \
      double, Eigen::Index, unfurl::DenseOperand<Eigen::ORDER>, unfurl::DenseKernel::mr,       \
      unfurl::DenseKernel::LhsProgress, unfurl::DenseKernel::LhsPacket4Packing, Eigen::ORDER>; \
  HOW template struct Eigen::internal::gemm_pack_rhs<double, Eigen::Index,                     \
                                                     unfurl::DenseOperand<Eigen::ORDER>,       \
                                                     unfurl::DenseKernel::nr, Eigen::ORDER>;

// Solutions for right sides of a type; a class's own members do not hold these.
#define UNFURL_DENSE_SOLVE(HOW, RIGHT)                                                             \
  HOW template void Eigen::ColPivHouseholderQR<Eigen::MatrixXd>::_solve_impl(const RIGHT&, RIGHT&) \
      const;                                                                                       \
  HOW template void Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>::_solve_impl(          \
      const RIGHT&, RIGHT&) const;                                                                 \
  HOW template void Eigen::LDLT<Eigen::MatrixXd, Eigen::Lower>::_solve_impl_transposed<true>(      \
      const RIGHT&, RIGHT&) const;                                                                 \
  HOW template void Eigen::LLT<Eigen::MatrixXd, Eigen::Lower>::_solve_impl_transposed<true>(       \
      const RIGHT&, RIGHT&) const;

// HOW: extern here, empty in dense.cc.
#define UNFURL_DENSE(HOW)                                                                         \
  UNFURL_DENSE_PRODUCT(HOW, ColMajor, ColMajor)                                                   \
  UNFURL_DENSE_PRODUCT(HOW, ColMajor, RowMajor)                                                   \
  UNFURL_DENSE_PRODUCT(HOW, RowMajor, ColMajor)                                                   \
  UNFURL_DENSE_PRODUCT(HOW, RowMajor, RowMajor)                                                   \
  UNFURL_DENSE_PACK(HOW, ColMajor)                                                                \
  UNFURL_DENSE_PACK(HOW, RowMajor)                                                                \
  HOW template struct Eigen::internal::gebp_kernel<                                               \
      double, double, Eigen::Index,                                                               \
      Eigen::internal::blas_data_mapper<double, Eigen::Index, Eigen::ColMajor, Eigen::Unaligned,  \
                                        1>,                                                       \
      unfurl::DenseKernel::mr, unfurl::DenseKernel::nr, false, false>;                            \
  HOW template class Eigen::BDCSVD<Eigen::MatrixXd>;                                              \
  HOW template class Eigen::JacobiSVD<Eigen::MatrixXd>;                                           \
  HOW template class Eigen::HouseholderQR<Eigen::MatrixXd>;                                       \
  HOW template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;                                 \
  HOW template class Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>;                     \
  HOW template class Eigen::LLT<Eigen::MatrixXd, Eigen::Lower>;                                   \
  HOW template class Eigen::LDLT<Eigen::MatrixXd, Eigen::Lower>;                                  \
  HOW template class Eigen::PartialPivLU<Eigen::MatrixXd>;                                        \
  HOW template class Eigen::FullPivLU<Eigen::MatrixXd>;                                           \
  HOW template Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>&                                    \
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>::compute(                                        \
      const Eigen::EigenBase<Eigen::MatrixXd>&, int);                                             \
  HOW template Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>&                                    \
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>::compute(                                        \
      const Eigen::EigenBase<Eigen::Matrix3d>&, int);                                             \
  HOW template Eigen::EigenSolver<Eigen::MatrixXd>& Eigen::EigenSolver<Eigen::MatrixXd>::compute( \
      const Eigen::EigenBase<Eigen::MatrixXd>&, bool);                                            \
  UNFURL_DENSE_SOLVE(HOW, Eigen::VectorXd)                                                        \
  UNFURL_DENSE_SOLVE(HOW, Eigen::MatrixXd)
// NOLINTEND(bugprone-macro-parentheses)

UNFURL_DENSE(extern)
