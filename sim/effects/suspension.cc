#include "sim/effects/suspension.h"

#include <cmath>

#include "base/loop.h"
#include "sim/implicit/tangent.h"

namespace unfurl::sim {

Suspension::Suspension(int bodies) : stiffness_(bodies, 0.0), x_(bodies, 0.0), y_(bodies, 0.0) {}

void Suspension::Set(int body, double stiffness, double x_hang, double y_hang, double kappa,
                     double theta_hang) {
  stiffness_[body] = stiffness;
  x_[body] = x_hang;
  y_[body] = y_hang;
  if (kappa > 0.0) turning_.push_back({body, kappa, theta_hang});
  ++count_;
}

void Suspension::AddLoad(const Motion& motion, Load load, double*) const {
  const int n = static_cast<int>(stiffness_.size());
  const double* __restrict k = stiffness_.data();
  const double* __restrict x = motion.x;
  const double* __restrict y = motion.y;
  const double* __restrict x_hang = x_.data();
  const double* __restrict y_hang = y_.data();
  double* __restrict fx = load.fx;
  double* __restrict fy = load.fy;
  UNFURL_INDEPENDENT
  for (int i = 0; i < n; ++i) {
    fx[i] -= k[i] * (x[i] - x_hang[i]);
    fy[i] -= k[i] * (y[i] - y_hang[i]);
  }
  for (const Turning& t : turning_) {
    load.m[t.body] -= t.kappa * std::sin(motion.theta[t.body] - t.theta_hang);
  }
}

double Suspension::Energy(const Motion& motion) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    const double dx = motion.x[i] - x_[i], dy = motion.y[i] - y_[i];
    sum += 0.5 * stiffness_[i] * (dx * dx + dy * dy);
  }
  for (const Turning& t : turning_) {
    const double half = std::sin(0.5 * (motion.theta[t.body] - t.theta_hang));
    sum += 2.0 * t.kappa * half * half;
  }
  return sum;
}

void Suspension::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    Tangent::Block& k = tangent->DiagonalK(static_cast<int>(i));
    k[0] += stiffness_[i];
    k[4] += stiffness_[i];
  }
  for (const Turning& t : turning_) {
    tangent->DiagonalK(t.body)[8] += t.kappa * std::cos(motion.theta[t.body] - t.theta_hang);
  }
}

}  // namespace unfurl::sim
