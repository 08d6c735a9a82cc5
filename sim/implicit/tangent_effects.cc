// What each effect adds to the tangent; the formulas are the derivatives of its load.
#include <algorithm>
#include <cmath>

#include "sim/effects/bending.h"
#include "sim/effects/dampers.h"
#include "sim/effects/forces.h"
#include "sim/effects/frictions.h"
#include "sim/effects/latches.h"
#include "sim/effects/linear_springs.h"
#include "sim/effects/moment_tables.h"
#include "sim/effects/motors.h"
#include "sim/effects/springs.h"
#include "sim/effects/suspension.h"
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

void Springs::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    tangent->AddCoordinate(motion, coordinates_[k], stiffness_[k], 0.0, Moment(k, motion));
  }
}

void Dampers::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    tangent->AddCoordinate(motion, coordinates_[k], 0.0, damping_[k], Moment(k, motion));
  }
}

void Frictions::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    tangent->AddCoordinate(motion, coordinates_[k], 0.0, Damping(k, motion), Moment(k, motion));
  }
}

void Motors::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    if (coordinates_[k].travel) {
      tangent->AddCoordinate(motion, coordinates_[k], 0.0, 0.0, Moment(k, motion));
    }
  }
}

void MomentTables::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    const Value v = At(k, coordinates_[k].Value(motion));
    tangent->AddCoordinate(motion, coordinates_[k], -v.slope, 0.0, v.moment);
  }
}

// With e along the line, T the tension and d the distance, H = k e e^T + T / d (1 - e e^T) between
// the two points, spread over the slots by d(point) = share [1 0 -oy; 0 1 ox] dq.
void LinearSprings::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (int k = 0; k < count(); ++k) {
    const Spring& spring = springs_[k];
    const State s = At(k, motion);
    const double across = s.length > 0.0 ? s.tension / s.length : 0.0;
    LoadPoint::Part parts[4];
    const int of_a = spring.a.Parts(motion, parts);
    const int count = of_a + spring.b.Parts(motion, parts + of_a);
    double along[4][3], normal[4][3];  // e.d(point), n.d(point), n = (-ey, ex)
    for (int i = 0; i < count; ++i) {
      const LoadPoint::Part& p = parts[i];
      const double w = i < of_a ? -p.share : p.share;
      const double e[3] = {w * s.ex, w * s.ey, w * (p.ox * s.ey - p.oy * s.ex)};
      const double n[3] = {-w * s.ey, w * s.ex, w * (p.ox * s.ex + p.oy * s.ey)};
      std::copy_n(e, 3, along[i]);
      std::copy_n(n, 3, normal[i]);
      // The offset turns: its second derivative is minus itself.
      tangent->DiagonalK(p.slot)[8] -= s.tension * w * (s.ex * p.ox + s.ey * p.oy);
    }
    for (int i = 0; i < count; ++i) {
      for (int j = i; j < count; ++j) {
        Tangent::Block stiff{}, damp{};
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) {
            const double ee = along[i][r] * along[j][c];
            stiff[3 * r + c] = spring.stiffness * ee + across * normal[i][r] * normal[j][c];
            damp[3 * r + c] = spring.damping * ee;
          }
        }
        if (i != j && parts[i].slot == parts[j].slot) {
          for (Tangent::Block* block : {&stiff, &damp}) {
            const Tangent::Block once = *block;
            for (int m = 0; m < 9; ++m) (*block)[m] += once[m % 3 * 3 + m / 3];
          }
        }
        tangent->AddPair(parts[i].slot, parts[j].slot, stiff, &damp);
      }
    }
  }
}

void Forces::AddTangent(const Motion& motion, Tangent* tangent) const {
  for (const Force& f : forces_) {
    if (f.follows) continue;
    LoadPoint::Part parts[2];
    const int count = f.point.Parts(motion, parts);
    const double fx = f.force[0].Value(motion.t), fy = f.force[1].Value(motion.t);
    for (int i = 0; i < count; ++i) {
      tangent->DiagonalK(parts[i].slot)[8] +=
          parts[i].share * (fx * parts[i].ox + fy * parts[i].oy);
    }
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
