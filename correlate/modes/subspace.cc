#include "correlate/modes/subspace.h"

#include <algorithm>
#include <cmath>

#include "base/dense.h"

namespace unfurl::correlate {

namespace {
using Complex = std::complex<double>;
}  // namespace

Subspace::Subspace(const LagCovariances& covariances, Eigen::Index l, Eigen::Index rows,
                   double step)
    : covariances_(covariances),
      l_(l),
      r_(static_cast<Eigen::Index>(covariances.references.size())),
      rows_(rows),
      step_(step) {
  Eigen::MatrixXd H(l_ * rows_, r_ * rows_);
  for (Eigen::Index i = 0; i < rows_; ++i) {
    for (Eigen::Index j = 0; j < rows_; ++j) {
      H.block(i * l_, j * r_, l_, r_) = covariances.At(i + j + 1, l_);
    }
  }
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  U_ = svd.matrixU();
  V_ = svd.matrixV();
  s_ = svd.singularValues();
}

Eigen::Index Subspace::most() const {
  // One block row fewer than there are can be shifted, and a direction must be left to be noise.
  return 2 * ((std::min(l_ * (rows_ - 1), r_ * rows_) - 1) / 2);
}

Subspace::Realisation Subspace::Realise(Eigen::Index order) const {
  Realisation out;
  const Eigen::Index n = l_ * (rows_ - 1);
  out.up = U_.topLeftCorner(n, order);
  out.down = U_.block(l_, 0, n, order);
  const Eigen::MatrixXd normal = out.up.transpose() * out.up;
  out.inverse = normal.ldlt().solve(Eigen::MatrixXd::Identity(order, order));
  out.A = out.inverse * (out.up.transpose() * out.down);
  return out;
}

std::vector<SubspacePole> Subspace::Poles(Eigen::Index order) const {
  std::vector<SubspacePole> out;
  const Realisation at = Realise(order);
  const Eigen::EigenSolver<Eigen::MatrixXd> eigen(at.A);
  if (eigen.info() != Eigen::Success) return out;
  const Eigen::MatrixXcd right = eigen.eigenvectors();
  const Eigen::PartialPivLU<Eigen::MatrixXcd> lu(right);
  const Eigen::MatrixXcd left = lu.inverse();  // its rows, left^H right = 1
  if (!left.allFinite()) return out;
  // First block column of the controllability matrix, U1 being the observability matrix.
  const Eigen::MatrixXd G = s_.head(order).asDiagonal() * V_.topLeftCorner(r_, order).transpose();
  for (Eigen::Index k = 0; k < order; ++k) {
    const Complex z = eigen.eigenvalues()(k);
    if (!(z.imag() > 0.0) || !(std::abs(z) > 0.0)) continue;
    SubspacePole p;
    p.order = static_cast<int>(order);
    p.pole = std::log(z) / step_;
    p.right = right.col(k);
    p.left = left.row(k).adjoint();
    p.shape = U_.topLeftCorner(l_, order) * p.right;
    Eigen::Index at_most = 0;
    p.shape.cwiseAbs().maxCoeff(&at_most);
    const Complex largest = p.shape(at_most);
    p.shape /= largest;
    p.right /= largest;
    p.left *= std::conj(largest);
    p.control = (p.left.adjoint() * G).transpose() / z;  // R_1 = shape z control^T
    out.push_back(std::move(p));
  }
  std::sort(out.begin(), out.end(), [](const SubspacePole& a, const SubspacePole& b) {
    return std::abs(a.pole) < std::abs(b.pole);
  });
  return out;
}

// With O = U1 a change of U1 within its own span is a change of basis, which moves neither poles
// nor shapes. What is left is U2 K, K_kj = (s_j G_kj + s_k G_jk) / (s_j^2 - s_k^2), G = U^T dH V.
Eigen::VectorXcd Subspace::Functional(const Realisation& at, Complex z,
                                      const Eigen::VectorXcd& right, const Eigen::VectorXcd& left,
                                      const Eigen::VectorXcd& of_rows) const {
  const Eigen::Index m = l_ * rows_, c = r_ * rows_, n = at.A.rows(), up = m - l_;
  // left^T dA right = w^T dO right + e^T (up of dO) b, e what the least squares leave.
  const Eigen::VectorXcd b = at.inverse * left;
  const Eigen::VectorXcd a = at.up * b;
  Eigen::VectorXcd w = of_rows;
  w.tail(up) += a;
  w.head(up) -= z * a;
  const Eigen::VectorXcd e = at.down * right - z * (at.up * right);
  Eigen::VectorXcd of_up = Eigen::VectorXcd::Zero(m);
  of_up.head(up) = e;
  const auto U1 = U_.leftCols(n), U2 = U_.rightCols(m - n);
  const auto V1 = V_.leftCols(n), V2 = V_.rightCols(c - n);
  const Eigen::VectorXcd g = U2.transpose() * w, h = U2.transpose() * of_up;
  Eigen::MatrixXcd W = g * right.transpose() + h * b.transpose();  // of K
  Eigen::MatrixXcd X12 = Eigen::MatrixXcd::Zero(n, c - n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index k = 0; k < m - n; ++k) {
      const double sk = n + k < s_.size() ? s_(n + k) : 0.0;
      W(k, j) /= s_(j) * s_(j) - sk * sk;
      if (k < c - n) X12(j, k) = W(k, j) * sk;
      W(k, j) *= s_(j);
    }
  }
  const Eigen::MatrixXcd M = U2 * (W * V1.transpose()) + U1 * (X12 * V2.transpose());
  // By lag: each R_k stands on one anti-diagonal of blocks.
  Eigen::VectorXcd weights = Eigen::VectorXcd::Zero(covariances_.blocks.rows());
  for (Eigen::Index i = 0; i < rows_; ++i) {
    for (Eigen::Index j = 0; j < rows_; ++j) {
      Eigen::Map<Eigen::MatrixXcd> lag(weights.data() + (i + j + 1) * l_ * r_, l_, r_);
      lag += M.block(i * l_, j * r_, l_, r_);
    }
  }
  return covariances_.blocks.transpose() * weights;
}

Eigen::VectorXcd Subspace::Influence(const SubspacePole& p) const {
  const Complex z = std::exp(p.pole * step_);
  return Functional(Realise(p.order), z, p.right, p.left.conjugate(),
                    Eigen::VectorXcd::Zero(l_ * rows_)) /
         (z * step_);
}

Eigen::MatrixXcd Subspace::ShapeInfluence(const SubspacePole& p) const {
  const Realisation at = Realise(p.order);
  const Complex z = std::exp(p.pole * step_);
  const Eigen::EigenSolver<Eigen::MatrixXd> eigen(at.A);
  const Eigen::MatrixXcd right = eigen.eigenvectors();
  const Eigen::MatrixXcd left = Eigen::PartialPivLU<Eigen::MatrixXcd>(right).inverse();
  Eigen::VectorXcd apart(p.order);
  for (Eigen::Index q = 0; q < p.order; ++q) apart(q) = z - eigen.eigenvalues()(q);
  Eigen::Index own = 0;
  apart.cwiseAbs().minCoeff(&own);
  Eigen::MatrixXcd out(l_, covariances_.blocks.cols());
  for (Eigen::Index o = 0; o < l_; ++o) {
    // C times the change of the eigenvector, of which its own direction is only a scale.
    Eigen::RowVectorXcd of = U_.row(o).head(p.order) * right;
    for (Eigen::Index q = 0; q < p.order; ++q) of(q) = q == own ? 0.0 : of(q) / apart(q);
    Eigen::VectorXcd row = Eigen::VectorXcd::Zero(l_ * rows_);
    row(o) = 1.0;
    out.row(o) = Functional(at, z, p.right, (of * left).transpose(), row).transpose();
  }
  // The largest entry stays 1.
  Eigen::Index at_most = 0;
  p.shape.cwiseAbs().maxCoeff(&at_most);
  const Eigen::RowVectorXcd largest = out.row(at_most);
  return out - p.shape * largest;
}

Eigen::MatrixXcd Subspace::ControlOfBlocks(const SubspacePole& p) const {
  const Eigen::Index blocks = covariances_.blocks.cols();
  // The pole's row of the pseudo-inverse of O, on the first block column of H.
  const Eigen::RowVectorXcd row = p.left.adjoint() * U_.leftCols(p.order).transpose();
  const Complex z = std::exp(p.pole * step_);
  Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(r_, blocks);
  for (Eigen::Index b = 0; b < blocks; ++b) {
    for (Eigen::Index i = 0; i < rows_; ++i) {
      const double* own = covariances_.blocks.col(b).data() + (i + 1) * l_ * r_;
      const Eigen::Map<const Eigen::MatrixXd> change(own, l_, r_);
      out.col(b) += (row.segment(i * l_, l_) * (change + covariances_.At(i + 1, l_))).transpose();
    }
  }
  return out / z;
}

}  // namespace unfurl::correlate
