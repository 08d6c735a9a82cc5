// What bending adds to the tangent: the derivatives of its load.
#include <cmath>

#include "sim/effects/bending.h"
#include "sim/implicit/tangent.h"

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

}  // namespace unfurl::sim
