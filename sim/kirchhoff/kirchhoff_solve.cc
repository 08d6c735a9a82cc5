// Mass matrix, forces, and what comes of them.
#include <algorithm>
#include <type_traits>

#include "sim/kirchhoff/kirchhoff.h"
#include "sim/kirchhoff/kirchhoff_blocks.h"

namespace unfurl::sim {
namespace {

// Rows of a product that are summed side by side.
constexpr int kKirchhoffSolveLanes = 4;

}  // namespace

// How places move with theta_0 and the amplitudes: the attachments' about the common centre, beside
// the mass matrix.
template <int kWidth, bool kStretches>
void KirchhoffRod::AssembleAttachments(Work* work) const {
  constexpr int kRow = kWidth / kBlock;
  const int points = shapes_.points, used = shapes_.count + 1, stride = row();
  const double* shape = shapes_.shape.data();
  const double* c = work->cosine.data();
  const double* s = work->sine.data();
  double* system = work->system.data();
  const int count = static_cast<int>(attachments_.size());
  double* cx = work->centre_x.data();
  double* cy = work->centre_y.data();
  for (int k = 0; k < kWidth; ++k) cx[k] = cy[k] = 0.0;
  for (int b = 0; b < count; ++b) {
    double* jx = &work->jx[b * kWidth];
    double* jy = &work->jy[b * kWidth];
    const double* at = &attached_shape_[b * kWidth];
    const double* arm = &arm_[b * points];
    const double ox = work->offset[2 * b], oy = work->offset[2 * b + 1];
    Block x[kRow], y[kRow];
    for (int k = 0; k < kRow; ++k) {
      x[k] = -oy * Blocks(at)[k];
      y[k] = ox * Blocks(at)[k];
    }
    for (int q = 0; q < points; ++q) {
      if constexpr (kStretches) {
        for (int k = 0; k < kRow; ++k) {
          x[k] += arm[q] * Blocks(&work->turn_x[q * kWidth])[k];
          y[k] += arm[q] * Blocks(&work->turn_y[q * kWidth])[k];
        }
      } else {
        const double wx = -arm[q] * s[q], wy = arm[q] * c[q];
        for (int k = 0; k < kRow; ++k) {
          x[k] += wx * Blocks(shape + q * kWidth)[k];
          y[k] += wy * Blocks(shape + q * kWidth)[k];
        }
      }
    }
    for (int k = 0; k < kRow; ++k) {
      Blocks(jx)[k] = x[k];
      Blocks(jy)[k] = y[k];
    }
  }
  for (int b = 0; bodies_ && b < count; ++b) {
    const double part = attachments_[b].mass / total_mass_;
    for (int k = 0; k < kRow; ++k) {
      Blocks(cx)[k] += part * Blocks(&work->jx[b * kWidth])[k];
      Blocks(cy)[k] += part * Blocks(&work->jy[b * kWidth])[k];
    }
  }
  for (int b = 0; b < count; ++b) {
    for (int j = 0; j < used; ++j) {
      double* out = system + j * stride + kWidth + 3 * b;
      out[0] = work->jx[b * kWidth + j] - cx[j];
      out[1] = work->jy[b * kWidth + j] - cy[j];
      out[2] = attached_shape_[b * kWidth + j];
    }
  }
}

// The mass matrix of theta_0 and the amplitudes about the line's own centre.
template <int kWidth>
void KirchhoffRod::AssembleLine(Work* work) const {
  const int points = shapes_.points, used = shapes_.count + 1, stride = row();
  const double* __restrict shape = shapes_.shape.data();
  FillProducts(work);
  double* system = work->system.data();
  constexpr int kRow = kWidth / kBlock;
  // N^T (A N), four rows of A N at a time.
  Block total[kWidth][kRow] = {};
  for (int p = 0; p < points; p += kKirchhoffSolveLanes) {
    Block sum[kKirchhoffSolveLanes][kRow] = {};
    const double* products = &work->products[p * points];
    for (int q = 0; q < points; ++q) {
      for (int l = 0; l < kKirchhoffSolveLanes; ++l) {
        for (int k = 0; k < kRow; ++k) {
          sum[l][k] += products[l * points + q] * Blocks(shape + q * kWidth)[k];
        }
      }
    }
    for (int l = 0; l < kKirchhoffSolveLanes; ++l) {
      for (int j = 0; j < kWidth; ++j) {
        for (int k = 0; k < kRow; ++k) total[j][k] += shape[(p + l) * kWidth + j] * sum[l][k];
      }
    }
  }
  for (int j = 0; j < used; ++j) {
    for (int k = 0; k < kRow; ++k) Blocks(system + j * stride)[k] = total[j][k];
  }
}

// The same about the common centre, with the attached bodies.
template <int kWidth, bool kStretches>
void KirchhoffRod::AssembleMass(Work* work) const {
  if constexpr (kStretches) {
    AssembleStretchedLine<kWidth>(work);
  } else {
    AssembleLine<kWidth>(work);
  }
  if (!bodies_) return;
  constexpr int kRow = kWidth / kBlock;
  const int used = shapes_.count + 1, stride = row();
  double* system = work->system.data();
  const auto add = [&](double factor, const double* row) {
    for (int j = 0; j < used; ++j) {
      for (int k = 0; k < kRow; ++k) {
        Blocks(system + j * stride)[k] += factor * row[j] * Blocks(row)[k];
      }
    }
  };
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    const double m = attachments_[b].mass, inertia = attachments_[b].inertia;
    if (m > 0.0) add(m, &work->jx[b * kWidth]), add(m, &work->jy[b * kWidth]);
    if (inertia > 0.0) add(inertia, &attached_shape_[b * kWidth]);
  }
  add(-total_mass_, work->centre_x.data());
  add(-total_mass_, work->centre_y.data());
}

// The generalized force in the last used column of the system, and the common centre's
// acceleration.
template <int kWidth, bool kStretches>
void KirchhoffRod::AssembleForce(const double load[2], const double* attached, Work* work,
                                 double* dissipated) const {
  const int points = shapes_.points, used = shapes_.count + 1, stride = row();
  const int padded = PaddedSize(points);
  const double* __restrict c = work->cosine.data();
  const double* __restrict s = work->sine.data();
  const double* __restrict spin = work->rate.data();
  double* __restrict px = work->push.data();
  double* __restrict py = px + padded;
  double* __restrict ux = py + padded;
  double* __restrict uy = ux + padded;
  const double sigma = strings_.gravity_per_length;
  const double hx = sigma * hang_cosine_, hy = sigma * hang_sine_;
  for (int q = 0; q < points; ++q) {
    const double w = spin[q] * spin[q] - sigma;
    px[q] = w * c[q] + hx;
    py[q] = w * s[q] + hy;
    ux[q] = uy[q] = 0.0;
  }
  if constexpr (kStretches) PushStretched(work);
  for (int q = 0; q < points; ++q) {
    const double* __restrict kernel = &kernel_[q * points];
    const double wx = px[q], wy = py[q];
    for (int p = 0; p < points; ++p) {
      ux[p] += wx * kernel[p];
      uy[p] += wy * kernel[p];
    }
  }
  constexpr int kRow = kWidth / kBlock;
  Block force[kRow] = {};
  const double beta = properties_.damping;
  const double* a = work->a.data();
  const double* a_rate = work->a_rate.data();
  for (int q = 0; q < points; ++q) {
    if constexpr (kStretches) {
      for (int k = 0; k < kRow; ++k) {
        force[k] += ux[q] * Blocks(&work->turn_x[q * kWidth])[k] +
                    uy[q] * Blocks(&work->turn_y[q * kWidth])[k];
      }
    } else {
      const double f = c[q] * uy[q] - s[q] * ux[q];
      for (int k = 0; k < kRow; ++k) force[k] += f * Blocks(&shapes_.shape[q * kWidth])[k];
    }
  }
  for (int k = 0; k < kRow; ++k) {
    force[k] -= Blocks(stiffness_.data())[k] * (Blocks(a)[k] + beta * Blocks(a_rate)[k]);
  }
  if (dissipated != nullptr && beta > 0.0) {
    double power = 0.0;
    for (int k = 0; k < kWidth; ++k) power += stiffness_[k] * a_rate[k] * a_rate[k];
    *dissipated += beta * power;
  }
  double fx = load[0], fy = load[1];
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    const double m = attachments_[b].mass;
    const double bx = attached[3 * b] - m * work->bias[2 * b];
    const double by = attached[3 * b + 1] - m * work->bias[2 * b + 1];
    const double bm = attached[3 * b + 2];
    for (int k = 0; k < kRow; ++k) {
      force[k] += bx * Blocks(&work->jx[b * kWidth])[k] + by * Blocks(&work->jy[b * kWidth])[k] +
                  bm * Blocks(&attached_shape_[b * kWidth])[k];
    }
    fx += bx;
    fy += by;
  }
  work->drift[0] = fx / total_mass_;
  work->drift[1] = fy / total_mass_;
  double* column = work->system.data() + kWidth + 3 * attachments_.size();
  for (int k = 0; k < used; ++k) {
    column[k * stride] =
        force[k / kBlock][k % kBlock] - work->centre_x[k] * fx - work->centre_y[k] * fy;
  }
}

template <int kWidth>
void KirchhoffRod::Eliminate(Work* work) const {
  const int used = shapes_.count + 1, stride = row();
  double* system = work->system.data();
  const int blocks = stride / kBlock;
  for (int k = 0; k < used; ++k) {
    const double* pivot = system + k * stride;
    const double inverse = 1.0 / pivot[k];
    work->inverse[k] = inverse;
    for (int i = k + 1; i < used; ++i) {
      const double l = pivot[i] * inverse;
      work->factor[i * kWidth + k] = l;
      double* out = system + i * stride;
      for (int j = 0; j < blocks; ++j) Blocks(out)[j] -= l * Blocks(pivot)[j];
    }
  }
}

template <int kWidth, bool kStretches>
void KirchhoffRod::SolveAs(const double load[2], const double* attached, Work* work,
                           double* acceleration, double* compliance, double* dissipated) const {
  // The mass matrix last: what is written entry by entry has then long reached the cache when
  // elimination reads it in blocks.
  if constexpr (kStretches) FillTurns(work);
  AssembleAttachments<kWidth, kStretches>(work);
  AssembleForce<kWidth, kStretches>(load, attached, work, dissipated);
  AssembleMass<kWidth, kStretches>(work);
  Eliminate<kWidth>(work);
  const int used = shapes_.count + 1, stride = row();
  const int rows = 3 * static_cast<int>(attachments_.size());
  for (int i = 0; i < rows; ++i) {
    double* out = compliance + i * rows;
    const double* base = work->system.data() + kWidth;
    for (int j = 0; j <= rows; j += kBlock) {
      Block sum = {};
      for (int k = 0; k < used; ++k) {
        const double* y = base + k * stride;
        sum += y[i] * work->inverse[k] * *Blocks(y + j);
      }
      for (int b = 0; b < kBlock && j + b < rows; ++b) out[j + b] = sum[b];
      if (rows < j + kBlock) acceleration[i] = sum[rows - j];
    }
  }
  const double inverse_mass = 1.0 / total_mass_;
  for (int i = 0; i < rows; ++i) {
    if (i % 3 == 2) continue;
    acceleration[i] += work->drift[i % 3] + work->bias[2 * (i / 3) + i % 3];
    for (int j = i % 3; j < rows; j += 3) compliance[i * rows + j] += inverse_mass;
  }
}

void KirchhoffRod::Solve(const double load[2], const double* attached, Work* work,
                         double* acceleration, double* compliance, double* dissipated) const {
  const auto as = [&](auto blocks_wide, auto stretching) {
    SolveAs<decltype(blocks_wide)::value * kBlock, decltype(stretching)::value>(
        load, attached, work, acceleration, compliance, dissipated);
  };
  const int blocks = shapes_.width / kBlock;
  constexpr std::integral_constant<int, 1> kOne;
  constexpr std::integral_constant<int, 2> kTwo;
  constexpr std::integral_constant<int, 3> kThree;
  constexpr std::integral_constant<int, 4> kFour;
  if (stretches()) {
    constexpr std::true_type kStretches;
    if (blocks == 1) return as(kOne, kStretches);
    if (blocks == 2) return as(kTwo, kStretches);
    return blocks == 3 ? as(kThree, kStretches) : as(kFour, kStretches);
  }
  constexpr std::false_type kNone;
  return blocks == 1 ? as(kOne, kNone) : as(kTwo, kNone);
}

void KirchhoffRod::BackSubstitute(Work* work) const {
  const int used = shapes_.count + 1, width = shapes_.width;
  double* __restrict alpha = work->alpha.data();
  for (int k = 0; k < used; ++k) alpha[k] *= work->inverse[k];
  for (int k = used - 1; k > 0; --k) {
    const double* __restrict l = &work->factor[k * width];
    const double a = alpha[k];
    for (int i = 0; i < k; ++i) alpha[i] -= l[i] * a;
  }
}

void KirchhoffRod::Answer(const double* attached, bool free, Work* work, double* out) const {
  const int used = shapes_.count + 1, stride = row();
  const int rows = 3 * static_cast<int>(attachments_.size());
  double fx = 0.0, fy = 0.0;
  for (int i = 0; i < rows; i += 3) {
    fx += attached[i];
    fy += attached[i + 1];
  }
  const double* base = work->system.data() + shapes_.width;
  for (int k = 0; k < used; ++k) {
    const double* y = base + k * stride;
    double sum = free ? y[rows] : 0.0;
    for (int i = 0; i < rows; ++i) sum += y[i] * attached[i];
    work->alpha[k] = sum;
  }
  BackSubstitute(work);
  out[0] = (free ? work->drift[0] : 0.0) + fx / total_mass_;
  out[1] = (free ? work->drift[1] : 0.0) + fy / total_mass_;
  for (int k = 0; k < used; ++k) {
    out[0] -= work->centre_x[k] * work->alpha[k];
    out[1] -= work->centre_y[k] * work->alpha[k];
    out[2 + k] = work->alpha[k];
  }
}

void KirchhoffRod::Accelerate(const double* attached, Work* work, double* acceleration) const {
  Answer(attached, true, work, acceleration);
}

void KirchhoffRod::Respond(const double* attached, Work* work, double* change) const {
  Answer(attached, false, work, change);
}

}  // namespace unfurl::sim
