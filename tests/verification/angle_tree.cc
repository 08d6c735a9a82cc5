#include "angle_tree.h"

#include <Eigen/Dense>

namespace unfurl::reference {

using Complex = AngleTree::Complex;

Complex AngleTree::PointOf(const std::vector<double>& y, const std::vector<Complex>& arm) const {
  Complex r = floats_ ? Complex(y[0], y[1]) : Complex(0.0);
  for (int k = 0; k < angles_; ++k) r += arm[k] * std::polar(1.0, phi(y, k));
  return r;
}

void AngleTree::RightSide(double t, const std::vector<double>& y, std::vector<double>& dydt) const {
  const int n = coordinates();
  Forces forces{std::vector<Complex>(bodies.size()), std::vector<double>(angles_)};
  if (load) load(t, y, forces);
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd Q = Eigen::VectorXd::Zero(n);
  std::vector<Complex> J(n);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Body& body = bodies[b];
    if (floats_) J[0] = 1.0, J[1] = Complex(0.0, 1.0);
    Complex bias = 0.0;  // acceleration at zero second derivatives
    for (int k = 0; k < angles_; ++k) {
      const Complex arm = body.arm[k] * std::polar(1.0, phi(y, k));
      J[first() + k] = Complex(0.0, 1.0) * arm;
      bias -= arm * rate(y, k) * rate(y, k);
    }
    const Complex force = forces.on_body[b] - body.mass * bias;
    for (int i = 0; i < n; ++i) {
      Q[i] += std::real(std::conj(J[i]) * force);
      for (int j = 0; j < n; ++j) M(i, j) += body.mass * std::real(std::conj(J[i]) * J[j]);
    }
    M(first() + body.angle, first() + body.angle) += body.inertia;
  }
  for (int k = 0; k < angles_; ++k) Q[first() + k] += forces.on_angle[k];
  const Eigen::VectorXd a = M.ldlt().solve(Q);
  dydt.resize(y.size());
  for (int i = 0; i < n; ++i) dydt[i] = y[n + i], dydt[n + i] = a[i];
}

double AngleTree::Kinetic(const std::vector<double>& y) const {
  double T = 0.0;
  for (const Body& body : bodies) {
    Complex v = floats_ ? Complex(y[coordinates()], y[coordinates() + 1]) : Complex(0.0);
    for (int k = 0; k < angles_; ++k) {
      v += Complex(0.0, rate(y, k)) * body.arm[k] * std::polar(1.0, phi(y, k));
    }
    T += 0.5 * body.mass * std::norm(v) + 0.5 * body.inertia * std::pow(rate(y, body.angle), 2);
  }
  return T;
}

}  // namespace unfurl::reference
