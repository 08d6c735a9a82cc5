// Of a smooth beam that stretches: its directions are d = lambda t, t = (cos, sin) of theta and
// n = (-sin, cos), and move with the coordinates as
//   d(d)/da_k = lambda N_k n,   d(d)/db_j = E_j t.
#include <algorithm>
#include <cmath>

#include "sim/kirchhoff/kirchhoff.h"
#include "sim/kirchhoff/kirchhoff_blocks.h"

namespace unfurl::sim {
namespace {

// Rows of a product that are summed side by side.
constexpr int kStretchLanes = 4;

}  // namespace

void KirchhoffRod::UpdateStretched(const double* q, const double* rate, Work* work) const {
  const int points = shapes_.points, width = shapes_.width;
  const double* theta = work->theta.data();
  const double* spin = work->rate.data();
  const double* c = work->cosine.data();
  const double* s = work->sine.data();
  for (int p = 0; p < points; ++p) {
    double stretch = 1.0, stretch_rate = 0.0;
    for (int k = shapes_.bends + 1; k <= shapes_.count; ++k) {
      stretch += shapes_.strain[p * width + k] * work->a[k];
      stretch_rate += shapes_.strain[p * width + k] * work->a_rate[k];
    }
    work->stretch[p] = stretch;
    work->stretch_rate[p] = stretch_rate;
  }
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    double x = q[0], y = q[1], vx = rate[0], vy = rate[1], ax = 0.0, ay = 0.0;
    for (int p = 0; p < points; ++p) {
      // Along t and n: d'= (along, across), and d'' with the coordinates' own left out.
      const double arm = arm_[b * points + p], lambda = work->stretch[p], w = spin[p];
      const double along = work->stretch_rate[p], across = lambda * w;
      const double pull = -across * w, turn = 2.0 * along * w;
      x += arm * lambda * c[p];
      y += arm * lambda * s[p];
      vx += arm * (along * c[p] - across * s[p]);
      vy += arm * (along * s[p] + across * c[p]);
      ax += arm * (pull * c[p] - turn * s[p]);
      ay += arm * (pull * s[p] + turn * c[p]);
    }
    const Attachment& at = attachments_[b];
    const double omega = spin[points + b], ca = c[points + b], sa = s[points + b];
    const double ox = ca * at.px - sa * at.py, oy = sa * at.px + ca * at.py;
    work->frame[b] = {x + ox,          y + oy,          theta[points + b] + at.angle,
                      vx - omega * oy, vy + omega * ox, omega};
    work->bias[2 * b] = ax - omega * omega * ox;
    work->bias[2 * b + 1] = ay - omega * omega * oy;
    work->offset[2 * b] = ox;
    work->offset[2 * b + 1] = oy;
  }
}

void KirchhoffRod::FillTurns(Work* work) const {
  const int width = shapes_.width;
  for (int p = 0; p < shapes_.points; ++p) {
    const double c = work->cosine[p], s = work->sine[p], lambda = work->stretch[p];
    for (int k = 0; k < width; ++k) {
      const double turn = lambda * shapes_.shape[p * width + k],
                   pull = shapes_.strain[p * width + k];
      work->turn_x[p * width + k] = pull * c - turn * s;
      work->turn_y[p * width + k] = pull * s + turn * c;
    }
  }
}

template <int kWidth>
void KirchhoffRod::AssembleStretchedLine(Work* work) const {
  const int points = shapes_.points, used = shapes_.count + 1, stride = row();
  constexpr int kRow = kWidth / kBlock;
  Block total[kWidth][kRow] = {};
  for (const Array* turns : {&work->turn_x, &work->turn_y}) {
    const double* turn = turns->data();
    for (int p = 0; p < points; p += kStretchLanes) {
      Block sum[kStretchLanes][kRow] = {};
      for (int q = 0; q < points; ++q) {
        for (int l = 0; l < kStretchLanes; ++l) {
          const double kernel = kernel_[(p + l) * points + q];
          for (int k = 0; k < kRow; ++k) sum[l][k] += kernel * Blocks(turn + q * kWidth)[k];
        }
      }
      for (int l = 0; l < kStretchLanes; ++l) {
        for (int j = 0; j < used; ++j) {
          for (int k = 0; k < kRow; ++k) total[j][k] += turn[(p + l) * kWidth + j] * sum[l][k];
        }
      }
    }
  }
  for (int j = 0; j < used; ++j) {
    for (int k = 0; k < kRow; ++k) Blocks(&work->system[j * stride])[k] = total[j][k];
  }
}

template void KirchhoffRod::AssembleStretchedLine<kBlock>(Work* work) const;
template void KirchhoffRod::AssembleStretchedLine<2 * kBlock>(Work* work) const;
template void KirchhoffRod::AssembleStretchedLine<3 * kBlock>(Work* work) const;
template void KirchhoffRod::AssembleStretchedLine<4 * kBlock>(Work* work) const;

// What the directions are pushed by: their own acceleration at rest of the coordinates, and
// strings.
void KirchhoffRod::PushStretched(Work* work) const {
  const double sigma = strings_.gravity_per_length;
  double* px = work->push.data();
  double* py = px + PaddedSize(shapes_.points);
  for (int q = 0; q < shapes_.points; ++q) {
    const double c = work->cosine[q], s = work->sine[q], spin = work->rate[q];
    const double along = work->stretch[q] * (spin * spin - sigma);
    const double across = -2.0 * work->stretch_rate[q] * spin;
    px[q] = along * c - across * s + sigma * hang_cosine_;
    py[q] = along * s + across * c + sigma * hang_sine_;
  }
}

double KirchhoffRod::StretchedKinetic(const Work& work) const {
  const int points = shapes_.points;
  double sum = 0.0;
  for (int a = 0; a < points; ++a) {
    const double along = work.stretch_rate[a], across = work.stretch[a] * work.rate[a];
    for (int b = 0; b < points; ++b) {
      const double cosine = work.cosine[a] * work.cosine[b] + work.sine[a] * work.sine[b];
      const double sine = work.cosine[a] * work.sine[b] - work.sine[a] * work.cosine[b];
      const double other = work.stretch_rate[b], turn = work.stretch[b] * work.rate[b];
      sum += kernel_[a * points + b] *
             (cosine * (along * other + across * turn) + sine * (across * other - along * turn));
    }
  }
  return 0.5 * sum;
}

double KirchhoffRod::StretchedMomentum(const Work& work) const {
  const int points = shapes_.points;
  double sum = 0.0;
  for (int a = 0; a < points; ++a) {
    for (int b = 0; b < points; ++b) {
      const double cosine = work.cosine[a] * work.cosine[b] + work.sine[a] * work.sine[b];
      const double sine = work.cosine[a] * work.sine[b] - work.sine[a] * work.cosine[b];
      sum += kernel_[a * points + b] * work.stretch[a] *
             (cosine * work.stretch[b] * work.rate[b] + sine * work.stretch_rate[b]);
    }
  }
  return sum;
}

double KirchhoffRod::Stretching(const Work& work) const {
  double sum = 0.0;
  for (int k = shapes_.bends + 1; k <= shapes_.count; ++k) {
    sum += stiffness_[k] * work.a[k] * work.a[k];
  }
  return 0.5 * sum;
}

double KirchhoffRod::LeastStretch(const Work& work) const {
  if (!stretches()) return 1.0;
  return *std::min_element(work.stretch.begin(), work.stretch.begin() + shapes_.points);
}

double KirchhoffRod::Strain(double at, const double* q) const {
  double sum = 0.0;
  for (int j = 0; j < shapes_.stretches; ++j) {
    sum += shapes_.Strain(j, at) * q[3 + shapes_.bends + j];
  }
  return sum;
}

KirchhoffRod::Frame KirchhoffRod::StretchedAt(const Place& place, const double* q,
                                              const double* rate) const {
  Frame frame{q[0], q[1], 0.0, rate[0], rate[1], 0.0};
  for (int p = 0; p < shapes_.points; ++p) {
    double theta = 0.0, spin = 0.0, lambda = 1.0, along = 0.0;
    for (int k = 0; k <= shapes_.count; ++k) {
      const double turn = shapes_.shape[p * shapes_.width + k];
      const double pull = shapes_.strain[p * shapes_.width + k];
      theta += turn * q[2 + k];
      spin += turn * rate[2 + k];
      lambda += pull * q[2 + k];
      along += pull * rate[2 + k];
    }
    const double w = properties_.length * place.arm[p];
    const double c = std::cos(theta), s = std::sin(theta);
    frame.x += w * lambda * c;
    frame.y += w * lambda * s;
    frame.vx += w * (along * c - lambda * spin * s);
    frame.vy += w * (along * s + lambda * spin * c);
  }
  for (int k = 0; k <= shapes_.count; ++k) {
    frame.theta += place.shape[k] * q[2 + k];
    frame.omega += place.shape[k] * rate[2 + k];
  }
  return frame;
}

// As AddGeometric, with d^2(d)/da_k da_l = -lambda N_k N_l t and d^2(d)/da_k db_j = N_k E_j n.
void KirchhoffRod::AddStretchedGeometric(const Work& work, const double* attached,
                                         double* k) const {
  const int points = shapes_.points, used = shapes_.count + 1, width = shapes_.width;
  const int size = coordinates();
  const double sigma = strings_.gravity_per_length;
  const auto add = [&](double factor, const double* left, const double* right) {
    for (int i = 0; i < used; ++i) {
      for (int j = 0; j < used; ++j) k[(2 + i) * size + 2 + j] += factor * left[i] * right[j];
    }
  };
  for (int p = 0; p < points; ++p) {
    double fx = 0.0, fy = 0.0;  // what acts on this direction
    for (std::size_t b = 0; b < attachments_.size(); ++b) {
      fx += arm_[b * points + p] * attached[3 * b];
      fy += arm_[b * points + p] * attached[3 * b + 1];
    }
    for (int q = 0; sigma > 0.0 && q < points; ++q) {
      const double pair = sigma * kernel_[p * points + q];
      fx -= pair * (work.stretch[q] * work.cosine[q] - hang_cosine_);
      fy -= pair * (work.stretch[q] * work.sine[q] - hang_sine_);
      add(pair, &work.turn_x[p * width], &work.turn_x[q * width]);
      add(pair, &work.turn_y[p * width], &work.turn_y[q * width]);
    }
    const double c = work.cosine[p], s = work.sine[p];
    const double along = fx * c + fy * s, across = fy * c - fx * s;
    const double *turn = &shapes_.shape[p * width], *pull = &shapes_.strain[p * width];
    add(along * work.stretch[p], turn, turn);
    add(-across, turn, pull);
    add(-across, pull, turn);
  }
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    const double* shape = &attached_shape_[b * width];
    add(attached[3 * b] * work.offset[2 * b] + attached[3 * b + 1] * work.offset[2 * b + 1], shape,
        shape);
  }
}

}  // namespace unfurl::sim
