// What each effect adds to the tangent; the formulas are the derivatives of its load.
#include <algorithm>
#include <cmath>

#include "sim/bending.h"
#include "sim/latches.h"
#include "sim/springs.h"
#include "sim/suspension.h"
#include "sim/tangent.h"

namespace unfurl::sim {

// With r the relative position, phi the mean angle and d = (dx, dy) in element axes,
//   grad dy = n = (-s, c | -dx/2, -dx/2),  grad dx = t = (c, s | dy/2, dy/2),  grad dtheta = m
// with respect to (r | theta_i, theta_j), so K = k_s n n^T + k_b m m^T + k_a t t^T + F_y grad n +
// F_x grad t, and D = beta times the first three.
void Bending::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (shear_[e] == 0.0 && axial_stiffness_[e] == 0.0) continue;
    tangent->NoteElement(e, beta_[e] > 0.0);
    const double sum_c = motion.c[e] + motion.c[e + 1], sum_s = motion.s[e] + motion.s[e + 1];
    const double scale = 1.0 / std::sqrt(sum_c * sum_c + sum_s * sum_s);
    const double c = sum_c * scale, s = sum_s * scale;
    const double rx = motion.x[e + 1] - motion.x[e], ry = motion.y[e + 1] - motion.y[e];
    const double dx = c * rx + s * ry, dy = c * ry - s * rx;
    const double ks = shear_[e], kb = bend_[e], ka = axial_stiffness_[e];
    const double fy = ks * dy, fx = ka * (dx - length_[e]);

    // Entries: xx, xy, yy of r; x and y of r with either angle; the angles with themselves and
    // with each other.
    double xx = ks * s * s + ka * c * c, xy = (ka - ks) * s * c, yy = ks * c * c + ka * s * s;
    double xt = 0.5 * (ks * s * dx + ka * c * dy), yt = 0.5 * (-ks * c * dx + ka * s * dy);
    const double both = 0.25 * (ks * dx * dx + ka * dy * dy);
    if (beta_[e] > 0.0) {
      Tangent::Block &i = tangent->DiagonalD(e), &j = tangent->DiagonalD(e + 1);
      Tangent::Scatter(beta_[e], xx, xy, yy, xt, yt, both + kb, both - kb, &i,
                       &tangent->ElementD(e), &j);
    }
    xt += 0.5 * (-fy * c - fx * s);
    yt += 0.5 * (-fy * s + fx * c);
    const double turned = both - 0.25 * (fy * dy + fx * dx);
    Tangent::Scatter(1.0, xx, xy, yy, xt, yt, turned + kb, turned - kb, &tangent->DiagonalK(e),
                     &tangent->ElementK(e), &tangent->DiagonalK(e + 1));
  }
}

void Springs::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    tangent->AddCoordinate(motion, coordinates_[k], stiffness_[k], 0.0, Moment(k, motion));
  }
}

void Suspension::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (std::size_t i = 0; i < stiffness_.size(); ++i) {
    Tangent::Block& k = tangent->DiagonalK(static_cast<int>(i));
    k[0] += stiffness_[i];
    k[4] += stiffness_[i];
  }
  for (const Turning& t : turning_) {
    tangent->DiagonalK(t.slot)[8] += t.kappa * std::cos(motion.theta[t.slot] - t.theta_hang);
  }
}

void Latches::AddTangent(const Motion& motion, const std::vector<LatchMode>& modes,
                         Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    const Law& law = laws_[k];
    double stiffness = 0.0, damping = 0.0;
    for (const bool upper : {true, false}) {
      if (!(upper ? modes[k].upper_contact : modes[k].lower_contact)) continue;
      const Contact c = At(k, upper, hinges_[k].Theta(motion), hinges_[k].Rate(motion));
      if (!(c.depth > 0.0) || c.held) continue;
      const bool zone = c.depth < law.epsilon;
      const double T = zone ? std::exp(2.0 * (c.depth - law.epsilon) * law.Q / law.epsilon) : 1.0;
      const double slope = zone ? 2.0 * law.Q / law.epsilon * T : 0.0;  // dT/d(delta)
      const double arm = law.lever * law.lever;
      stiffness += arm * (1.5 * law.K * std::sqrt(c.depth) + law.C * slope * c.depth_rate);
      damping += arm * law.C * T;
    }
    tangent->AddHinge(hinges_[k], stiffness, damping);
  }
}

}  // namespace unfurl::sim
