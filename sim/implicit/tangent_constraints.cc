// The constraints' part of the tangent: K = -sum lambda (second derivatives of the row).
#include "sim/constraints/constraints.h"
#include "sim/implicit/tangent.h"

namespace unfurl::sim {

void Constraints::AddTangent(const Motion& m, const Work& work, const double* lambda,
                             Tangent* tangent) const {
  // (r_j - r_i).e_i: n = (-s, c) with respect to (theta_i, r_j), -n to (theta_i, r_i),
  // -(r_j - r_i).e_i to theta_i twice. |r|: n n^T / |r| with respect to r twice.
  for (int e = 0; e + 1 < beam_count_; ++e) {
    if (active_[e] == 0.0) continue;
    tangent->NoteElement(e, false);
    const double c = work.axis_x[e], s = work.axis_y[e];
    const double along = (m.x[e + 1] - m.x[e]) * c + (m.y[e + 1] - m.y[e]) * s;
    if (chord_[e] > 0.0) {
      Tangent::Scatter(-lambda[e] / along, s * s, -s * c, c * c, 0.0, 0.0, 0.0, 0.0,
                       &tangent->DiagonalK(e), &tangent->ElementK(e), &tangent->DiagonalK(e + 1));
      continue;
    }
    const double kx = lambda[e] * s, ky = -lambda[e] * c;
    Tangent::Block &i = tangent->DiagonalK(e), &ij = tangent->ElementK(e);
    i[8] += lambda[e] * along;
    i[2] -= kx, i[6] -= kx;
    i[5] -= ky, i[7] -= ky;
    ij[6] += kx, ij[7] += ky;
  }
  joints_.AddTangent(work.joints.data(), lambda + beam_count_, tangent);
}

void JointRows::AddTangent(const double* g, const double* lambda, Tangent* tangent) const {
  // A pin's gap: minus the offset, to its angle twice.
  for (const Pin& pin : pins) {
    tangent->DiagonalK(pin.inner)[8] -= lambda[0] * g[0] + lambda[1] * g[1];
    tangent->DiagonalK(pin.outer)[8] += lambda[0] * g[2] + lambda[1] * g[3];
    lambda += 2;
    g += 4;
  }
  // e.(r_o + q - r_i) with e and q turning: n = e turned by a right angle.
  for (const Along& a : alongs) {
    const double f = -*lambda++ * a.sign;
    const double ex = g[0], ey = g[1], nx = -ey, ny = ex;
    const double q = ex * g[4] + ey * g[5];
    const double reach = ex * (g[6] + g[2]) + ey * (g[7] + g[3]);
    Tangent::Block& i = tangent->DiagonalK(a.inner);
    i[8] -= f * reach;
    i[2] -= f * nx, i[6] -= f * nx;
    i[5] -= f * ny, i[7] -= f * ny;
    tangent->DiagonalK(a.outer)[8] -= f * q;
    tangent->AddPair(a.inner, a.outer, {0, 0, 0, 0, 0, 0, f * nx, f * ny, f * q}, nullptr);
    g += 8;
  }
}

}  // namespace unfurl::sim
