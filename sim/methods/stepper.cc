#include "sim/methods/stepper.h"

#include <algorithm>

namespace unfurl::sim {

Stepper::Stepper(Dynamics& dynamics, const ErrorScale& scale)
    : dynamics_(dynamics),
      scale_(scale),
      n_(dynamics.model().rigid_bodies.count),
      size_(dynamics.model().index.size()),
      y_(size_, 0.0),
      trial_(size_, 0.0),
      stage_(size_, 0.0),
      position_weight_(n_, 0.0),
      angle_weight_(n_, 0.0),
      mask_(n_, 0.0) {
  int moving = 0;
  for (int s = 0; s < n_; ++s) {
    if (!dynamics.model().rigid_bodies.IsDynamic(s)) continue;
    mask_[s] = 1.0;
    ++moving;
  }
  SetTolerance(scale.rtol);
  mass_ = dynamics.model().rigid_bodies.mass;
  inertia_ = dynamics.model().rigid_bodies.inertia;
  const KirchhoffBeams& smooth = dynamics.model().kirchhoff;
  for (int b = 0; b < smooth.count(); ++b) {
    // Amplitudes stand as lengths (x, y) or angles; the norm wants their weight to some factor.
    const KirchhoffBeams::Beam& beam = smooth.beam(b);
    const double mass = beam.rod.properties().mass, length = beam.rod.properties().length;
    for (int k = 0; k < beam.amplitude_bodies(); ++k) {
      mass_[beam.first_amplitude() + k] = mass;
      inertia_[beam.first_amplitude() + k] = mass * length * length;
    }
  }
  norm_factor_ = 1.0 / (6.0 * std::max(moving, 1));
}

void Stepper::SetTolerance(double rtol) {
  scale_.rtol = rtol;
  for (int s = 0; s < n_; ++s) {
    position_weight_[s] = mask_[s] / (rtol * scale_.length);
    angle_weight_[s] = mask_[s] / (rtol * scale_.angle);
  }
}

void Stepper::Start(double t, const std::vector<double>& y) {
  t_ = t;
  std::copy(y.begin(), y.end(), y_.begin());
  Refresh();
}

bool Stepper::Stage(double t, double* y, double* rate) {
  if (!Settle(t, y)) return false;
  dynamics_.RightSide(t, y, rate);
  ++evaluations_;
  return true;
}

void Stepper::AcceptUntil(double sigma, double t) {
  Dense(sigma, stage_.data());
  std::swap(y_, stage_);
  t_ = t;
}

void Stepper::Dense(double sigma, double* out) {
  for (int i = 0; i < size_; ++i) out[i] = Polynomial(i)(sigma);
}

DensePolynomial Stepper::Cubic(int entry, double* margin) const {
  *margin = 0.0;
  return const_cast<Stepper*>(this)->Polynomial(entry);
}

double Stepper::WeightedError(int i) const {
  const double error = ErrorOf(i);
  const int block = i / n_, body = i % n_;
  if (block < 2) return position_weight_[body] * error;
  if (block < 3) return angle_weight_[body] * error;
  const double floor = block < 5 ? scale_.speed : scale_.spin;
  return mask_[body] * error / (scale_.rtol * (floor + std::fabs(y_[i])));
}

double Stepper::FastestRate(const double* state_a, const double* rate_a, const double* state_b,
                            const double* rate_b) const {
  double states = 0.0, rates = 0.0;
  for (int block = 0; block < 3; ++block) {
    const double* mass = block < 2 ? mass_.data() : inertia_.data();
    for (int k = 0; k < n_; ++k) {
      const int x = block * n_ + k, v = x + 3 * n_;
      const double dx = state_a[x] - state_b[x], da = rate_a[v] - rate_b[v];
      states += mass[k] * dx * dx;
      rates += mass[k] * da * da;
    }
  }
  return states > 0.0 ? std::sqrt(std::sqrt(rates / states)) : 0.0;
}

int Stepper::WorstBody() const {
  int worst = 0;
  double largest = -1.0;
  for (int i = 0; i < 6 * n_; ++i) {
    const double e = std::fabs(WeightedError(i));
    if (e > largest || (!std::isfinite(e) && std::isfinite(largest))) {
      largest = e;
      worst = i % n_;
    }
  }
  return worst;
}

}  // namespace unfurl::sim
