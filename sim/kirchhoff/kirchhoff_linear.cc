// Of a smooth beam its mass matrix, how its attachments move with its coordinates, and the
// stiffness of what turns with it.
#include <algorithm>

#include "sim/kirchhoff/kirchhoff.h"

namespace unfurl::sim {

void KirchhoffRod::Linearise(const Work& work, Linear* out) const {
  const int used = shapes_.count + 1, width = shapes_.width, size = coordinates();
  out->mass.assign(size * size, 0.0);
  double* mass = out->mass.data();
  // Kinetic energy: that of the common centre, whose rate is (x_c', y_c') + centre (theta_0', a'),
  // and the rest, L D L^T as Solve has factored it.
  mass[0] = mass[size + 1] = total_mass_;
  for (int i = 0; i < used; ++i) {
    mass[2 + i] = mass[(2 + i) * size] = total_mass_ * work.centre_x[i];
    mass[size + 2 + i] = mass[(2 + i) * size + 1] = total_mass_ * work.centre_y[i];
    for (int j = 0; j <= i; ++j) {
      double sum =
          total_mass_ * (work.centre_x[i] * work.centre_x[j] + work.centre_y[i] * work.centre_y[j]);
      for (int k = 0; k <= j; ++k) {
        const double li = i == k ? 1.0 : work.factor[i * width + k];
        const double lj = j == k ? 1.0 : work.factor[j * width + k];
        sum += li * lj / work.inverse[k];
      }
      mass[(2 + i) * size + 2 + j] = mass[(2 + j) * size + 2 + i] = sum;
    }
  }
  out->motion.assign(3 * size * attachments_.size(), 0.0);
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    double* x = out->motion.data() + 3 * size * b;
    double *y = x + size, *theta = y + size;
    x[0] = y[1] = 1.0;
    std::copy_n(work.jx.data() + b * width, used, x + 2);
    std::copy_n(work.jy.data() + b * width, used, y + 2);
    std::copy_n(attached_shape_.data() + b * width, used, theta + 2);
  }
}

void KirchhoffRod::FillMotions(const Work& work, double* motion) const {
  const int points = shapes_.points, width = shapes_.width, size = coordinates();
  for (std::size_t b = 0; b < attachments_.size(); ++b, motion += 3 * size) {
    double *x = motion, *y = x + size, *theta = y + size;
    std::fill_n(x, 3 * size, 0.0);
    x[0] = y[1] = 1.0;
    const double ox = work.offset[2 * b], oy = work.offset[2 * b + 1];
    for (int k = 0; k <= shapes_.count; ++k) {
      const double shape = attached_shape_[b * width + k];
      x[2 + k] = -oy * shape;
      y[2 + k] = ox * shape;
      theta[2 + k] = shape;
      for (int q = 0; q < points; ++q) {
        const double arm = arm_[b * points + q], c = work.cosine[q], s = work.sine[q];
        const double turn = shapes_.shape[q * width + k] * (stretches() ? work.stretch[q] : 1.0);
        const double pull = stretches() ? shapes_.strain[q * width + k] : 0.0;
        x[2 + k] += arm * (pull * c - turn * s);
        y[2 + k] += arm * (pull * s + turn * c);
      }
    }
  }
}

// A place of the line is a sum of arms along (cos, sin) of the directions theta = N (theta_0, a),
// so its second derivative is minus the arms' own; the strings' energy is a double sum over
// directions.
void KirchhoffRod::AddGeometric(const Work& work, const double* attached, double* k) const {
  if (stretches()) return AddStretchedGeometric(work, attached, k);
  const int points = shapes_.points, used = shapes_.count + 1, size = coordinates();
  const double* c = work.cosine.data();
  const double* s = work.sine.data();
  const double sigma = strings_.gravity_per_length;
  const auto add = [&](double factor, const double* left, const double* right) {
    for (int i = 0; i < used; ++i) {
      for (int j = 0; j < used; ++j) k[(2 + i) * size + 2 + j] += factor * left[i] * right[j];
    }
  };
  for (int p = 0; p < points; ++p) {
    const double* shape = &shapes_.shape[p * shapes_.width];
    double own = 0.0;
    for (std::size_t b = 0; b < attachments_.size(); ++b) {
      own += arm_[b * points + p] * (attached[3 * b] * c[p] + attached[3 * b + 1] * s[p]);
    }
    for (int q = 0; sigma > 0.0 && q < points; ++q) {
      const double pair = sigma * kernel_[p * points + q];
      own -= pair * (c[p] * (c[q] - hang_cosine_) + s[p] * (s[q] - hang_sine_));
      add(pair * (c[p] * c[q] + s[p] * s[q]), shape, &shapes_.shape[q * shapes_.width]);
    }
    add(own, shape, shape);
  }
  for (std::size_t b = 0; b < attachments_.size(); ++b) {
    const double* shape = &attached_shape_[b * shapes_.width];
    add(attached[3 * b] * work.offset[2 * b] + attached[3 * b + 1] * work.offset[2 * b + 1], shape,
        shape);
  }
}

}  // namespace unfurl::sim
