#include "sim/effects/bending.h"

#include <cmath>

#include "base/loop.h"

namespace unfurl::sim {
namespace {

// Keeps the axis of a pair that is no element finite; far below rounding where it is one.
constexpr double kTiny = 1e-30;

// What an element sees of its two stations.
struct Relative {
  double ce, se;  // the element's x axis
  double dx, dy, dtheta;
};

inline Relative Relate(double ci, double cj, double si, double sj, double rx, double ry,
                       double dtheta) {
  const double sum_c = ci + cj, sum_s = si + sj;
  // The sum of two unit vectors points along the mean of their angles.
  const double inverse = 1.0 / std::sqrt(sum_c * sum_c + sum_s * sum_s + kTiny);
  Relative r;
  r.ce = sum_c * inverse;
  r.se = sum_s * inverse;
  r.dx = r.ce * rx + r.se * ry;
  r.dy = r.ce * ry - r.se * rx;
  r.dtheta = dtheta;
  return r;
}

Relative RelateAt(const Motion& m, int e) {
  return Relate(m.c[e], m.c[e + 1], m.s[e], m.s[e + 1], m.x[e + 1] - m.x[e], m.y[e + 1] - m.y[e],
                m.theta[e + 1] - m.theta[e]);
}

}  // namespace

Bending::Bending(int beam_count)
    : beam_count_(beam_count),
      length_(beam_count, 1.0),
      beta_(beam_count, 0.0),
      gradient_(beam_count, 0.0),
      shear_(beam_count, 0.0),
      bend_(beam_count, 0.0),
      axial_stiffness_(beam_count, 0.0) {}

void Bending::Set(int e, const Element& element) {
  const double l = element.length;
  length_[e] = l;
  shear_[e] = 12.0 * element.EI / (l * l * l);
  bend_[e] = element.EI / l;
  axial_stiffness_[e] = element.EA / l;
  beta_[e] = element.beta;
  gradient_[e] = element.gradient_form ? 1.0 : 0.0;
  damped_ = damped_ || element.beta > 0.0;
  axial_ = axial_ || element.EA > 0.0;
  ++count_;
}

template <bool kDamped, bool kAxial, bool kPower>
void Bending::Forces(const Motion& motion, double* scratch) const {
  const int count = beam_count_;
  const int stride = count + kBlock;
  const double* __restrict px = motion.x;
  const double* __restrict py = motion.y;
  const double* __restrict pt = motion.theta;
  const double* __restrict pc = motion.c;
  const double* __restrict ps = motion.s;
  const double* __restrict vx = motion.vx;
  const double* __restrict vy = motion.vy;
  const double* __restrict omega = motion.omega;
  double* __restrict ex = scratch + 1;  // entry -1 stays 0
  double* __restrict ey = ex + stride;
  double* __restrict mi = ey + stride;
  double* __restrict mj = mi + stride;
  double* __restrict power = mj + stride;
  const double* __restrict length = length_.data();
  const double* __restrict shear = shear_.data();
  const double* __restrict bend = bend_.data();
  const double* __restrict axial = axial_stiffness_.data();
  const double* __restrict beta = beta_.data();
  const double* __restrict gradient = gradient_.data();
  UNFURL_INDEPENDENT
  for (int e = 0; e < count; ++e) {
    const Relative r = Relate(pc[e], pc[e + 1], ps[e], ps[e + 1], px[e + 1] - px[e],
                              py[e + 1] - py[e], pt[e + 1] - pt[e]);
    double y = r.dy, theta = r.dtheta, x = r.dx - length[e];
    if constexpr (kDamped) {
      const double rvx = vx[e + 1] - vx[e];
      const double rvy = vy[e + 1] - vy[e];
      const double spin = 0.5 * (omega[e] + omega[e + 1]);
      const double y_rate = r.ce * rvy - r.se * rvx - spin * r.dx;
      const double theta_rate = omega[e + 1] - omega[e];
      y += beta[e] * y_rate;
      theta += beta[e] * theta_rate;
      double x_rate = 0.0;
      if constexpr (kAxial) {
        x_rate = r.ce * rvx + r.se * rvy + spin * r.dy;
        x += beta[e] * x_rate;
      }
      if constexpr (kPower) {
        power[e] = beta[e] * (shear[e] * y_rate * y_rate + bend[e] * theta_rate * theta_rate +
                              (kAxial ? axial[e] * x_rate * x_rate : 0.0));
      }
    }
    const double fy = shear[e] * y;
    const double couple = bend[e] * theta;
    // As printed: -F_y l / 2 on both stations. The gradient adds -(F_y (dx - l) - F_x dy) / 2.
    double arm = fy * (length[e] + gradient[e] * (r.dx - length[e]));
    if constexpr (kAxial) {
      const double fx = axial[e] * x;
      arm -= gradient[e] * fx * r.dy;
      ex[e] = r.ce * fx - r.se * fy;
      ey[e] = r.se * fx + r.ce * fy;
    } else {
      ex[e] = -r.se * fy;
      ey[e] = r.ce * fy;
    }
    mi[e] = 0.5 * arm + couple;
    mj[e] = 0.5 * arm - couple;
  }
}

void Bending::AddLoad(const Motion& motion, double* scratch, Load load, double* dissipated) const {
  const bool power_wanted = dissipated != nullptr && damped_;
  if (damped_) {
    if (axial_) {
      power_wanted ? Forces<true, true, true>(motion, scratch)
                   : Forces<true, true, false>(motion, scratch);
    } else {
      power_wanted ? Forces<true, false, true>(motion, scratch)
                   : Forces<true, false, false>(motion, scratch);
    }
  } else {
    axial_ ? Forces<false, true, false>(motion, scratch)
           : Forces<false, false, false>(motion, scratch);
  }
  const int stride = beam_count_ + kBlock;
  const double* __restrict ex = scratch + 1;
  const double* __restrict ey = ex + stride;
  const double* __restrict mi = ey + stride;
  const double* __restrict mj = mi + stride;
  double* __restrict fx = load.fx;
  double* __restrict fy = load.fy;
  double* __restrict m = load.m;
  UNFURL_INDEPENDENT
  for (int k = 0; k < beam_count_; ++k) {
    fx[k] += ex[k] - ex[k - 1];
    fy[k] += ey[k] - ey[k - 1];
    m[k] += mi[k] + mj[k - 1];
  }
  if (power_wanted) {
    const double* power = mj + stride;
    double sum[kBlock] = {};
    for (int e = 0; e < beam_count_; e += kBlock) {
      for (int k = 0; k < kBlock; ++k) sum[k] += power[e + k];
    }
    double total = 0.0;
    for (double part : sum) total += part;
    *dissipated += total;
  }
}

double Bending::Energy(const Motion& motion) const {
  double sum = 0.0;
  UNFURL_INDEPENDENT
  for (int e = 0; e < beam_count_; ++e) {
    const Relative r = RelateAt(motion, e);
    sum += 0.5 * (shear_[e] * r.dy * r.dy + bend_[e] * r.dtheta * r.dtheta);
  }
  return sum;
}

double Bending::Strain(const Motion& motion, int e) const {
  if (axial_stiffness_[e] == 0.0) return 0.0;
  return (RelateAt(motion, e).dx - length_[e]) / length_[e];
}

double Bending::AxialEnergy(const Motion& motion) const {
  double sum = 0.0;
  for (int e = 0; e < beam_count_ && axial_; ++e) {
    const double x = RelateAt(motion, e).dx - length_[e];
    sum += 0.5 * axial_stiffness_[e] * x * x;
  }
  return sum;
}

}  // namespace unfurl::sim
