#include "modal_rod.h"

#include <boost/math/special_functions/legendre.hpp>
#include <cmath>

namespace unfurl::reference {

using Complex = ModalRod::Complex;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ModalRod::ModalRod(int shapes, bool is_clamped) : clamped(is_clamped), shapes_(shapes) {
  // Gauss points on [-1, 1] are the zeros of P_n; the integral of P_m is
  // (P_{m+1} - P_{m-1}) / (2 m + 1).
  const auto P = [](int m, double x) { return boost::math::legendre_p(m, x); };
  const std::vector<double> half = boost::math::legendre_p_zeros<double>(kNodes);
  std::vector<double> x;
  for (std::size_t k = half.size(); k-- > 1;) x.push_back(-half[k]);
  for (const double zero : half) x.push_back(zero);
  node_.resize(kNodes), weight_.resize(kNodes);
  integral_ = MatrixXd::Zero(kNodes, kNodes);
  for (int j = 0; j < kNodes; ++j) {
    const double slope = boost::math::legendre_p_prime(kNodes, x[j]);
    node_[j] = 0.5 * (1.0 + x[j]);
    weight_[j] = 1.0 / ((1.0 - x[j] * x[j]) * slope * slope);
  }
  for (int i = 0; i < kNodes; ++i) {
    for (int m = 0; m < kNodes; ++m) {
      const double of_p = m == 0 ? x[i] + 1.0 : (P(m + 1, x[i]) - P(m - 1, x[i])) / (2 * m + 1);
      for (int j = 0; j < kNodes; ++j) {
        integral_(i, j) += 0.5 * (2 * m + 1) * weight_[j] * P(m, x[j]) * of_p;
      }
    }
  }
  shape_.resize(kNodes, shapes_);
  for (int j = 0; j < kNodes; ++j) {
    for (int k = 0; k < shapes_; ++k) shape_(j, k) = Shape(k, node_[j]);
  }
}

double ModalRod::Shape(int k, double part) const {
  return clamped ? std::sin((k + 0.5) * M_PI * part) : std::cos(k * M_PI * part);
}

void ModalRod::RightSide(double t, const std::vector<double>& y, std::vector<double>& dydt) const {
  const int n = shapes_;
  const Base b = base(t);
  const Eigen::Map<const VectorXd> amplitude(y.data(), n), rate(y.data() + n, n);
  const VectorXd psi = (shape_ * amplitude).array() + (clamped ? b.angle : 0.0);
  const VectorXd spin = (shape_ * rate).array() + (clamped ? b.rate : 0.0);
  const double twist = clamped ? b.angular_acceleration : 0.0;
  Eigen::VectorXcd tangent(kNodes), bend(kNodes);
  for (int j = 0; j < kNodes; ++j) {
    tangent[j] = std::polar(1.0, psi[j]);
    bend[j] = (Complex(0.0, twist) - spin[j] * spin[j]) * tangent[j];
  }
  // Of every node, and of the end (last row): dr/db_k, and the acceleration at zero b_k''.
  Eigen::MatrixXcd J(kNodes + 1, n);
  Eigen::VectorXcd bias(kNodes + 1);
  MatrixXd integral(kNodes + 1, kNodes);
  integral << integral_, weight_.transpose();
  integral *= length;
  for (int k = 0; k < n; ++k) {
    J.col(k) = integral * (Complex(0.0, 1.0) * shape_.col(k).array() * tangent.array()).matrix();
  }
  bias = (integral * bend).array() + b.acceleration;
  VectorXd m(kNodes + 1);
  m << weight_ * mass, tip_mass;
  const MatrixXd re = J.real(), im = J.imag();
  MatrixXd M = re.transpose() * m.asDiagonal() * re + im.transpose() * m.asDiagonal() * im;
  Eigen::VectorXcd force = m.asDiagonal() * (gravity - bias.array()).matrix();
  force[kNodes] += tip_force;
  VectorXd Q = re.transpose() * force.real() + im.transpose() * force.imag();
  for (int k = 0; k < n; ++k) {
    const double wave = (clamped ? k + 0.5 : k) * M_PI / length;
    Q[k] -= EI * wave * wave * 0.5 * length * (amplitude[k] + damping * rate[k]);
  }
  VectorXd a;
  if (tip_on_x_axis) {
    MatrixXd K = MatrixXd::Zero(n + 1, n + 1);
    VectorXd right(n + 1);
    K.topLeftCorner(n, n) = M;
    K.block(0, n, n, 1) = im.row(kNodes).transpose();
    K.block(n, 0, 1, n) = im.row(kNodes);
    right << Q, -bias[kNodes].imag();
    a = K.partialPivLu().solve(right).head(n);
  } else {
    a = M.llt().solve(Q);
  }
  dydt.resize(y.size());
  for (int k = 0; k < n; ++k) dydt[k] = y[n + k], dydt[n + k] = a[k];
}

ModalRod::Places ModalRod::At(double t, const std::vector<double>& y) const {
  const Base b = base(t);
  const VectorXd psi =
      (shape_ * Eigen::Map<const VectorXd>(y.data(), shapes_)).array() + (clamped ? b.angle : 0.0);
  Places places{b.place, b.place, b.place};
  for (int j = 0; j < kNodes; ++j) {
    const Complex tangent = std::polar(length, psi[j]);
    places.middle += integral_(kNodes / 2, j) * tangent;
    places.end += weight_[j] * tangent;
  }
  return places;
}

}  // namespace unfurl::reference
