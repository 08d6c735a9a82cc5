// The part of the constraints that runs in the loop.
#include <cmath>

#include "sim/constraints.h"

namespace unfurl::sim {
namespace {

// `values` come in whole blocks, zero beyond the rows.
double LargestMagnitude(const Array& values) {
  double largest[kBlock] = {};
  for (std::size_t i = 0; i < values.size(); i += kBlock) {
    for (int k = 0; k < kBlock; ++k) {
      const double v = std::fabs(values[i + k]);
      largest[k] = v > largest[k] ? v : largest[k];
    }
  }
  double all = 0.0;
  for (const double v : largest) all = v > all ? v : all;
  return all;
}

}  // namespace

void Constraints::FillGeometry(const Motion& m, Work* work) const {
  double* __restrict tilt = work->tilt.data();
  double* __restrict tilt_i = work->tilt_i.data();
  const double* __restrict active = active_.data();
#pragma GCC ivdep
  for (int e = 0; e < beam_count_; ++e) {
    const double t = active[e] * ((m.y[e + 1] - m.y[e]) * m.c[e] - (m.x[e + 1] - m.x[e]) * m.s[e]);
    tilt[e] = t;
    tilt_i[e] = t;
  }
  double* tilt_j = work->tilt_j.data();
  for (const Side& side : i_sides_) {
    const double ox = work->station[2 * side.station], oy = work->station[2 * side.station + 1];
    tilt_i[side.row] += m.c[side.row] * oy - m.s[side.row] * ox;
  }
  for (const Side& side : j_sides_) {
    const double ox = work->station[2 * side.station], oy = work->station[2 * side.station + 1];
    tilt_j[side.row] = m.s[side.row] * ox - m.c[side.row] * oy;
  }
  double* point = work->pin_points.data();
  for (const Pin& pin : pins_) {
    const double ci = m.c[pin.inner], si = m.s[pin.inner];
    const double co = m.c[pin.outer], so = m.s[pin.outer];
    point[0] = ci * pin.ix - si * pin.iy;
    point[1] = si * pin.ix + ci * pin.iy;
    point[2] = co * pin.ox - so * pin.oy;
    point[3] = so * pin.ox + co * pin.oy;
    point += 4;
  }
}

void Constraints::AssembleSchur(const Motion& m, Work* work) const {
  double* __restrict diagonal = work->diagonal.data();
  double* __restrict off = work->off.data();
  const double* __restrict tilt_i = work->tilt_i.data();
  const double* __restrict tilt_j = work->tilt_j.data();
  const double* __restrict mass_sum = mass_sum_.data();
  const double* __restrict inertia_i = inertia_i_.data();
  const double* __restrict inertia_j = inertia_j_.data();
  const double* __restrict shared = shared_.data();
  const double* __restrict c = m.c;
  const double* __restrict s = m.s;
  const int count = beam_count_;
#pragma GCC ivdep
  for (int e = 0; e < count; ++e) {
    diagonal[e] =
        mass_sum[e] + inertia_i[e] * tilt_i[e] * tilt_i[e] + inertia_j[e] * tilt_j[e] * tilt_j[e];
    off[e] = -shared[e] * (c[e] * c[e + 1] + s[e] * s[e + 1]);
  }
  for (int k = beam_count_; k < ldlt_.places(); ++k) off[k] = 0.0;
  const double* o = work->pin_points.data();
  int row = beam_count_, place = beam_count_;
  for (const Pin& pin : pins_) {
    const double mass = inverse_mass_[pin.inner] + inverse_mass_[pin.outer];
    const double ii = inverse_inertia_[pin.inner], io = inverse_inertia_[pin.outer];
    diagonal[row] = mass + ii * o[1] * o[1] + io * o[3] * o[3];
    diagonal[row + 1] = mass + ii * o[0] * o[0] + io * o[2] * o[2];
    off[place] = -ii * o[0] * o[1] - io * o[2] * o[3];
    row += 2;
    ++place;
    o += 4;
  }
  double* block = work->blocks.data();
  for (const Block& b : blocks_) {
    if (b.pin < 0) {
      const double sign = b.outer ? 1.0 : -1.0;
      block[0] = sign * m.c[b.row];
      block[1] = sign * m.s[b.row];
      block[2] = b.outer ? tilt_j[b.row] : tilt_i[b.row];
    } else {
      const double* p = work->pin_points.data() + 4 * b.pin + (b.outer ? 2 : 0);
      const double sign = b.outer ? 1.0 : -1.0;
      block[0] = b.row == 0 ? sign : 0.0;
      block[1] = b.row == 0 ? 0.0 : sign;
      block[2] = b.row == 0 ? -sign * p[1] : sign * p[0];
    }
    block += 3;
  }
  for (const Cross& x : crosses_) {
    const double* a = &work->blocks[3 * x.a];
    const double* b = &work->blocks[3 * x.b];
    off[x.place] += inverse_mass_[x.body] * (a[0] * b[0] + a[1] * b[1]) +
                    inverse_inertia_[x.body] * a[2] * b[2];
  }
}

void Constraints::ConstraintLoad(const Motion& m, Work* work) const {
  double* __restrict fx = work->fx.data();
  double* __restrict fy = work->fy.data();
  double* __restrict mm = work->m.data();
  const double* __restrict lambda = work->lambda.data();
  const double* __restrict tilt = work->tilt.data();
  const double* __restrict c = m.c;
  const double* __restrict sine = m.s;
  const int count = beam_count_;
  if (count > 0) {
    fx[0] = -c[0] * lambda[0];
    fy[0] = -sine[0] * lambda[0];
    mm[0] = tilt[0] * lambda[0];
  }
#pragma GCC ivdep
  for (int k = 1; k < count; ++k) {
    fx[k] = c[k - 1] * lambda[k - 1] - c[k] * lambda[k];
    fy[k] = sine[k - 1] * lambda[k - 1] - sine[k] * lambda[k];
    mm[k] = tilt[k] * lambda[k];
  }
  for (int k = count; k < n_; ++k) fx[k] = fy[k] = mm[k] = 0.0;
  const double* offset = work->station.data();
  for (const Station& s : stations_) {
    fx[s.body] += fx[s.slot];
    fy[s.body] += fy[s.slot];
    mm[s.body] += mm[s.slot] + offset[0] * fy[s.slot] - offset[1] * fx[s.slot];
    offset += 2;
  }
  const double* o = work->pin_points.data();
  const double* pin_lambda = lambda + beam_count_;
  for (const Pin& pin : pins_) {
    const double lx = pin_lambda[0], ly = pin_lambda[1];
    fx[pin.inner] -= lx;
    fy[pin.inner] -= ly;
    mm[pin.inner] -= o[0] * ly - o[1] * lx;
    fx[pin.outer] += lx;
    fy[pin.outer] += ly;
    mm[pin.outer] += o[2] * ly - o[3] * lx;
    pin_lambda += 2;
    o += 4;
  }
}

void Constraints::Accelerate(const Motion& m, Load load, Work* work) const {
  double* __restrict ax = work->ax.data();
  double* __restrict ay = work->ay.data();
  double* __restrict alpha = work->alpha.data();
  const double* __restrict im = inverse_mass_.data();
  const double* __restrict ii = inverse_inertia_.data();
  const double* __restrict load_x = load.fx;
  const double* __restrict load_y = load.fy;
  const double* __restrict load_m = load.m;
  const int n = n_;
#pragma GCC ivdep
  for (int k = 0; k < n; ++k) {
    ax[k] = load_x[k] * im[k];
    ay[k] = load_y[k] * im[k];
    alpha[k] = load_m[k] * ii[k];
  }
  if (count() == 0) return;

  // What the stations' accelerations would be without multipliers.
  const double* offset = work->station.data();
  for (const Station& s : stations_) {
    const double w2 = m.omega[s.body] * m.omega[s.body], a = alpha[s.body];
    ax[s.slot] = ax[s.body] - a * offset[1] - w2 * offset[0];
    ay[s.slot] = ay[s.body] + a * offset[0] - w2 * offset[1];
    alpha[s.slot] = a;
    offset += 2;
  }
  FillGeometry(m, work);
  double* __restrict b = work->lambda.data();
  const double* __restrict tilt = work->tilt.data();
  const double* __restrict active = active_.data();
  const double* __restrict x = m.x;
  const double* __restrict y = m.y;
  const double* __restrict vx = m.vx;
  const double* __restrict vy = m.vy;
  const double* __restrict omega = m.omega;
  const double* __restrict cosine = m.c;
  const double* __restrict sine = m.s;
  const int elements = beam_count_;
#pragma GCC ivdep
  for (int e = 0; e < elements; ++e) {
    const double c = cosine[e], s = sine[e], w = omega[e];
    const double along = (x[e + 1] - x[e]) * c + (y[e + 1] - y[e]) * s;
    const double gamma =
        w * (2.0 * ((vx[e + 1] - vx[e]) * s - (vy[e + 1] - vy[e]) * c) + w * along);
    b[e] = active[e] * (gamma - (ax[e + 1] - ax[e]) * c - (ay[e + 1] - ay[e]) * s) -
           tilt[e] * alpha[e];
  }
  const double* o = work->pin_points.data();
  double* pin_b = b + beam_count_;
  for (const Pin& pin : pins_) {
    const double wi2 = m.omega[pin.inner] * m.omega[pin.inner], ai = alpha[pin.inner];
    const double wo2 = m.omega[pin.outer] * m.omega[pin.outer], ao = alpha[pin.outer];
    pin_b[0] = wo2 * o[2] - wi2 * o[0] - (ax[pin.outer] - ao * o[3] - ax[pin.inner] + ai * o[1]);
    pin_b[1] = wo2 * o[3] - wi2 * o[1] - (ay[pin.outer] + ao * o[2] - ay[pin.inner] - ai * o[0]);
    pin_b += 2;
    o += 4;
  }
  AssembleSchur(m, work);
  ldlt_.FactorAndForward(work->diagonal.data(), work->off.data(), work->inverse.data(), b);
  ldlt_.Backward(work->off.data(), b);
  ConstraintLoad(m, work);
  const double* __restrict fx = work->fx.data();
  const double* __restrict fy = work->fy.data();
  const double* __restrict mm = work->m.data();
#pragma GCC ivdep
  for (int k = 0; k < n; ++k) {
    ax[k] = (load_x[k] + fx[k]) * im[k];
    ay[k] = (load_y[k] + fy[k]) * im[k];
    alpha[k] = (load_m[k] + mm[k]) * ii[k];
  }
}

double Constraints::PositionDrift(const Motion& m, Work* work) const {
  double* __restrict phi = work->lambda.data();
  const double* __restrict x = m.x;
  const double* __restrict y = m.y;
  const double* __restrict c = m.c;
  const double* __restrict s = m.s;
  const double* __restrict active = active_.data();
  const double* __restrict length = length_.data();
  const int count = beam_count_;
#pragma GCC ivdep
  for (int e = 0; e < count; ++e) {
    phi[e] = active[e] * ((x[e + 1] - x[e]) * c[e] + (y[e + 1] - y[e]) * s[e] - length[e]);
  }
  const double* o = work->pin_points.data();
  double* pin_phi = phi + beam_count_;
  for (const Pin& pin : pins_) {
    pin_phi[0] = x[pin.outer] + o[2] - x[pin.inner] - o[0];
    pin_phi[1] = y[pin.outer] + o[3] - y[pin.inner] - o[1];
    pin_phi += 2;
    o += 4;
  }
  return LargestMagnitude(work->lambda);
}

double Constraints::PositionDriftAt(const Motion& m, Work* work) const {
  FillGeometry(m, work);
  return PositionDrift(m, work);
}

double Constraints::VelocityDrift(const Motion& m, Work* work) const {
  double* __restrict rate = work->lambda.data();
  const double* __restrict vx = m.vx;
  const double* __restrict vy = m.vy;
  const double* __restrict omega = m.omega;
  const double* __restrict c = m.c;
  const double* __restrict s = m.s;
  const double* __restrict active = active_.data();
  const double* __restrict tilt = work->tilt.data();
  const int count = beam_count_;
#pragma GCC ivdep
  for (int e = 0; e < count; ++e) {
    rate[e] =
        active[e] * ((vx[e + 1] - vx[e]) * c[e] + (vy[e + 1] - vy[e]) * s[e]) + tilt[e] * omega[e];
  }
  const double* o = work->pin_points.data();
  double* pin_rate = rate + beam_count_;
  for (const Pin& pin : pins_) {
    const double wi = omega[pin.inner], wo = omega[pin.outer];
    pin_rate[0] = vx[pin.outer] - wo * o[3] - vx[pin.inner] + wi * o[1];
    pin_rate[1] = vy[pin.outer] + wo * o[2] - vy[pin.inner] - wi * o[0];
    pin_rate += 2;
    o += 4;
  }
  return LargestMagnitude(work->lambda);
}

void Constraints::RemoveDrift(const Motion& m, Work* work, double* x, double* y,
                              double* theta) const {
  ldlt_.Forward(work->off.data(), work->inverse.data(), work->lambda.data());
  ldlt_.Backward(work->off.data(), work->lambda.data());
  ConstraintLoad(m, work);
  for (int k = 0; k < n_; ++k) {
    x[k] -= inverse_mass_[k] * work->fx[k];
    y[k] -= inverse_mass_[k] * work->fy[k];
    theta[k] -= inverse_inertia_[k] * work->m[k];
  }
}

double Constraints::SmallestPivot(const Work& work, int* row) const {
  double smallest = 1.0;
  *row = -1;
  for (int k = 0; k < ldlt_.size(); ++k) {
    const int r = ldlt_.RowAt(k);
    double first = 0.0;  // the diagonal entry before elimination
    if (r < beam_count_) {
      first = mass_sum_[r] + inertia_i_[r] * work.tilt_i[r] * work.tilt_i[r] +
              inertia_j_[r] * work.tilt_j[r] * work.tilt_j[r];
    } else {
      const Pin& pin = pins_[(r - beam_count_) / 2];
      const double* o = &work.pin_points[4 * ((r - beam_count_) / 2)];
      const int axis = (r - beam_count_) % 2 == 0 ? 1 : 0;
      first = inverse_mass_[pin.inner] + inverse_mass_[pin.outer] +
              inverse_inertia_[pin.inner] * o[axis] * o[axis] +
              inverse_inertia_[pin.outer] * o[axis + 2] * o[axis + 2];
    }
    const double ratio = work.diagonal[r] / first;
    if (!(ratio >= smallest)) {
      smallest = ratio;
      *row = r;
    }
  }
  return smallest;
}

}  // namespace unfurl::sim
