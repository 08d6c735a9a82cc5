// The part of the constraints that runs in the loop.
#include <algorithm>
#include <cmath>

#include "base/loop.h"
#include "sim/constraints/constraints.h"

namespace unfurl::sim {
namespace {

// Of the first `count` values.
double LargestMagnitude(const Array& values, int count) {
  double largest[kBlock] = {};
  const int whole = count - count % kBlock;
  for (int i = 0; i < whole; i += kBlock) {
    for (int k = 0; k < kBlock; ++k) {
      const double v = std::fabs(values[i + k]);
      largest[k] = v > largest[k] ? v : largest[k];
    }
  }
  double all = 0.0;
  for (const double v : largest) all = v > all ? v : all;
  for (int i = whole; i < count; ++i) all = std::max(all, std::fabs(values[i]));
  return all;
}

}  // namespace

void Constraints::FillGeometry(const Motion& m, Work* work) const {
  double* __restrict tilt = work->tilt.data();
  double* __restrict tilt_i = work->tilt_i.data();
  double* __restrict axis_x = work->axis_x.data();
  double* __restrict axis_y = work->axis_y.data();
  const double* __restrict active = active_.data();
  const double* __restrict chord = chord_.data();
  UNFURL_INDEPENDENT
  for (int e = 0; e < beam_count_; ++e) {
    const double rx = m.x[e + 1] - m.x[e], ry = m.y[e + 1] - m.y[e];
    const bool along = chord[e] > 0.0;
    const double inverse = 1.0 / std::sqrt(along ? rx * rx + ry * ry : 1.0);
    const double ax = along ? rx * inverse : m.c[e], ay = along ? ry * inverse : m.s[e];
    // A distance does not depend on the segments' angles.
    const double t = along ? 0.0 : active[e] * (ry * ax - rx * ay);
    axis_x[e] = ax;
    axis_y[e] = ay;
    tilt[e] = t;
    tilt_i[e] = t;
  }
  double* tilt_j = work->tilt_j.data();
  for (const Side& side : i_sides_) {
    const double ox = work->station[2 * side.station], oy = work->station[2 * side.station + 1];
    tilt_i[side.row] += work->axis_x[side.row] * oy - work->axis_y[side.row] * ox;
  }
  for (const Side& side : j_sides_) {
    const double ox = work->station[2 * side.station], oy = work->station[2 * side.station + 1];
    tilt_j[side.row] = work->axis_y[side.row] * ox - work->axis_x[side.row] * oy;
  }
  joints_.FillGeometry(m, work->joints.data(), work->blocks.data());
}

void Constraints::AssembleSchur(Work* work) const {
  double* __restrict diagonal = work->diagonal.data();
  double* __restrict off = work->off.data();
  const double* __restrict tilt_i = work->tilt_i.data();
  const double* __restrict tilt_j = work->tilt_j.data();
  const double* __restrict mass_sum = mass_sum_.data();
  const double* __restrict inertia_i = inertia_i_.data();
  const double* __restrict inertia_j = inertia_j_.data();
  const double* __restrict shared = shared_.data();
  const double* __restrict c = work->axis_x.data();
  const double* __restrict s = work->axis_y.data();
  const int count = beam_count_;
  UNFURL_INDEPENDENT
  for (int e = 0; e < count; ++e) {
    diagonal[e] =
        mass_sum[e] + inertia_i[e] * tilt_i[e] * tilt_i[e] + inertia_j[e] * tilt_j[e] * tilt_j[e];
    off[e] = -shared[e] * (c[e] * c[e + 1] + s[e] * s[e + 1]);
  }
  for (int k = beam_count_; k < ldlt_.places(); ++k) off[k] = 0.0;
  const double* joint = work->blocks.data();
  const int joint_rows = joints_.rows();
  for (int k = 0; k < joint_rows; ++k) {
    diagonal[beam_count_ + k] = BodyProduct(joints_.Inner(k), joint, joint) +
                                BodyProduct(joints_.Outer(k), joint + 3, joint + 3);
    joint += 6;
  }
  const double* o = work->joints.data();
  int place = beam_count_;
  for (const JointRows::Pin& pin : joints_.pins) {
    const double ii = inverse_inertia_[pin.inner], io = inverse_inertia_[pin.outer];
    off[place] = -ii * o[0] * o[1] - io * o[2] * o[3];
    ++place;
    o += 4;
  }
  double* block = work->blocks.data() + 6 * joint_rows;
  for (const Block& b : blocks_) {
    const double sign = b.outer ? 1.0 : -1.0;
    block[0] = sign * c[b.row];
    block[1] = sign * s[b.row];
    block[2] = b.outer ? tilt_j[b.row] : tilt_i[b.row];
    block += 3;
  }
  for (const Cross& x : crosses_) {
    off[x.place] += BodyProduct(x.body, &work->blocks[x.a], &work->blocks[x.b]);
  }
  if (!beam_couplings_.empty()) AddBeamCouplings(work);
}

double Constraints::Product(const BeamCoupling& coupling, const Work& work) const {
  const double* a = &work.blocks[coupling.a];
  const double* b = &work.blocks[coupling.b];
  const double* c = &work.smooth_work.compliance[coupling.at];
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += a[i] * (c[0] * b[0] + c[1] * b[1] + c[2] * b[2]);
    c += coupling.stride;
  }
  return coupling.factor * sum;
}

void Constraints::AddBeamCouplings(Work* work) const {
  for (const BeamCoupling& coupling : beam_couplings_) {
    double* out = coupling.diagonal ? work->diagonal.data() : work->off.data();
    out[coupling.place] += Product(coupling, *work);
  }
}

void Constraints::ConstraintLoad(const Array& by_row, Work* work) const {
  double* __restrict fx = work->fx.data();
  double* __restrict fy = work->fy.data();
  double* __restrict mm = work->m.data();
  const double* __restrict lambda = by_row.data();
  const double* __restrict tilt = work->tilt.data();
  const double* __restrict c = work->axis_x.data();
  const double* __restrict sine = work->axis_y.data();
  const int count = beam_count_;
  if (count > 0) {
    fx[0] = -c[0] * lambda[0];
    fy[0] = -sine[0] * lambda[0];
    mm[0] = tilt[0] * lambda[0];
  }
  UNFURL_INDEPENDENT
  for (int k = 1; k < count; ++k) {
    fx[k] = c[k - 1] * lambda[k - 1] - c[k] * lambda[k];
    fy[k] = sine[k - 1] * lambda[k - 1] - sine[k] * lambda[k];
    mm[k] = tilt[k] * lambda[k];
  }
  for (int k = count; k < n_; ++k) fx[k] = fy[k] = mm[k] = 0.0;
  const double* offset = work->station.data();
  for (const Station& s : stations_) {
    fx[s.body] += fx[s.index];
    fy[s.body] += fy[s.index];
    mm[s.body] += mm[s.index] + offset[0] * fy[s.index] - offset[1] * fx[s.index];
    offset += 2;
  }
  joints_.AddLoad(work->joints.data(), work->blocks.data(), lambda + beam_count_, fx, fy, mm);
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
  UNFURL_INDEPENDENT
  for (int k = 0; k < n; ++k) {
    ax[k] = load_x[k] * im[k];
    ay[k] = load_y[k] * im[k];
    alpha[k] = load_m[k] * ii[k];
  }
  if (work->smooth != nullptr) {
    work->smooth->Solve(load, &work->smooth_work, ax, ay, alpha);
    if (count() == 0) {
      work->smooth->Accelerate(work->fx.data(), work->fy.data(), work->m.data(), &work->smooth_work,
                               ax, ay, alpha);
    }
  }
  if (count() == 0) return;

  // What the stations' accelerations would be without multipliers.
  const double* offset = work->station.data();
  for (const Station& s : stations_) {
    const double w2 = m.omega[s.body] * m.omega[s.body], a = alpha[s.body];
    ax[s.index] = ax[s.body] - a * offset[1] - w2 * offset[0];
    ay[s.index] = ay[s.body] + a * offset[0] - w2 * offset[1];
    alpha[s.index] = a;
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
  const double* __restrict cosine = work->axis_x.data();
  const double* __restrict sine = work->axis_y.data();
  const double* __restrict chord = chord_.data();
  const int elements = beam_count_;
  UNFURL_INDEPENDENT
  for (int e = 0; e < elements; ++e) {
    const double c = cosine[e], s = sine[e];
    const double along = (x[e + 1] - x[e]) * c + (y[e + 1] - y[e]) * s;
    const double across = (vx[e + 1] - vx[e]) * s - (vy[e + 1] - vy[e]) * c;
    // How fast the axis turns: with the segment, or as the stations move across the chord.
    const bool turns = chord[e] > 0.0;
    const double w = (turns ? -across : omega[e]) / (turns ? along : 1.0);
    const double gamma = w * (2.0 * across + w * along);
    b[e] = active[e] * (gamma - (ax[e + 1] - ax[e]) * c - (ay[e + 1] - ay[e]) * s) -
           tilt[e] * alpha[e];
  }
  joints_.Residual(m, work->joints.data(), work->blocks.data(), ax, ay, alpha, b + beam_count_);
  ClearDropped(b);
  AssembleSchur(work);
  ldlt_.FactorAndForward(work->diagonal.data(), work->off.data(), work->inverse.data(), b);
  ldlt_.Backward(work->off.data(), b);
  ConstraintLoad(work->lambda, work);
  const double* __restrict fx = work->fx.data();
  const double* __restrict fy = work->fy.data();
  const double* __restrict mm = work->m.data();
  UNFURL_INDEPENDENT
  for (int k = 0; k < n; ++k) {
    ax[k] = (load_x[k] + fx[k]) * im[k];
    ay[k] = (load_y[k] + fy[k]) * im[k];
    alpha[k] = (load_m[k] + mm[k]) * ii[k];
  }
  if (work->smooth != nullptr) {
    work->smooth->Accelerate(fx, fy, mm, &work->smooth_work, ax, ay, alpha);
  }
}

double Constraints::LargestDrift(const Array& by_row) const {
  const int angles = beam_count_ + joints_.first_angle();
  double largest = LargestMagnitude(by_row, angles);
  for (int row = angles; row < rows_; ++row) {
    largest = std::max(largest, arm_ * std::fabs(by_row[row]));
  }
  return largest;
}

double Constraints::PositionDrift(const Motion& m, Work* work) const {
  double* __restrict phi = work->drift.data();
  const double* __restrict x = m.x;
  const double* __restrict y = m.y;
  const double* __restrict c = work->axis_x.data();
  const double* __restrict s = work->axis_y.data();
  const double* __restrict active = active_.data();
  const double* __restrict length = length_.data();
  const int count = beam_count_;
  UNFURL_INDEPENDENT
  for (int e = 0; e < count; ++e) {
    phi[e] = active[e] * ((x[e + 1] - x[e]) * c[e] + (y[e + 1] - y[e]) * s[e] - length[e]);
  }
  joints_.Positions(m, work->joints.data(), phi + beam_count_);
  ClearDropped(phi);
  return LargestDrift(work->drift);
}

double Constraints::PositionDriftAt(const Motion& m, Work* work) const {
  FillGeometry(m, work);
  return PositionDrift(m, work);
}

double Constraints::VelocityDrift(const Motion& m, Work* work) const {
  double* __restrict rate = work->drift.data();
  const double* __restrict vx = m.vx;
  const double* __restrict vy = m.vy;
  const double* __restrict omega = m.omega;
  const double* __restrict c = work->axis_x.data();
  const double* __restrict s = work->axis_y.data();
  const double* __restrict active = active_.data();
  const double* __restrict tilt = work->tilt.data();
  const int count = beam_count_;
  UNFURL_INDEPENDENT
  for (int e = 0; e < count; ++e) {
    rate[e] =
        active[e] * ((vx[e + 1] - vx[e]) * c[e] + (vy[e + 1] - vy[e]) * s[e]) + tilt[e] * omega[e];
  }
  joints_.Velocities(m, work->joints.data(), work->blocks.data(), rate + beam_count_);
  ClearDropped(rate);
  return LargestDrift(work->drift);
}

void Constraints::RemoveDrift(Work* work, double* x, double* y, double* theta) const {
  ldlt_.Forward(work->off.data(), work->inverse.data(), work->drift.data());
  ldlt_.Backward(work->off.data(), work->drift.data());
  ConstraintLoad(work->drift, work);
  for (int k = 0; k < n_; ++k) {
    x[k] -= inverse_mass_[k] * work->fx[k];
    y[k] -= inverse_mass_[k] * work->fy[k];
    theta[k] -= inverse_inertia_[k] * work->m[k];
  }
  if (work->smooth != nullptr) {
    work->smooth->Respond(work->fx.data(), work->fy.data(), work->m.data(), &work->smooth_work, x,
                          y, theta);
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
      const double* J = &work.blocks[6 * (r - beam_count_)];
      first = BodyProduct(joints_.Inner(r - beam_count_), J, J) +
              BodyProduct(joints_.Outer(r - beam_count_), J + 3, J + 3);
      for (const BeamCoupling& coupling : beam_couplings_) {
        if (coupling.diagonal && coupling.place == r) first += Product(coupling, work);
      }
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
