#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include "base/random.h"
#include "correlate/modes/decay_fit.h"

namespace unfurl::correlate {

// Sums of damped sines on lines, in closed form, with noise; and the Cramer-Rao bound of their
// frequencies and dampings from the whole Fisher matrix, by differences: nothing of the fit's own.
struct PlantedMode {
  double frequency;                             // undamped natural [Hz]
  double damping;                               // ratio
  std::vector<std::complex<double>> amplitude;  // per signal, at t = 0
};

struct PlantedDecay {
  std::vector<PlantedMode> modes;
  std::vector<std::vector<double>> t;  // per signal [s]
  double sigma = 0.0;
  double rho = 0.0;  // correlation of the noise from sample to sample
  std::vector<double> level = {}, slope = {};

  std::size_t signals() const { return t.size(); }

  // Parameters: f, zeta per mode; then per signal: Re, Im of each mode, level, slope.
  Eigen::VectorXd Parameters() const {
    std::vector<double> p;
    for (const PlantedMode& m : modes) p.insert(p.end(), {m.frequency, m.damping});
    for (std::size_t j = 0; j < t.size(); ++j) {
      for (const PlantedMode& m : modes) {
        p.insert(p.end(), {m.amplitude[j].real(), m.amplitude[j].imag()});
      }
      p.insert(p.end(), {level.empty() ? 0.0 : level[j], slope.empty() ? 0.0 : slope[j]});
    }
    return Eigen::Map<Eigen::VectorXd>(p.data(), static_cast<Eigen::Index>(p.size()));
  }

  double Value(const Eigen::VectorXd& p, std::size_t j, double at) const {
    const auto k = static_cast<Eigen::Index>(modes.size());
    const Eigen::Index own = 2 * k + static_cast<Eigen::Index>(j) * (2 * k + 2);
    double y = p(own + 2 * k) + p(own + 2 * k + 1) * at;
    for (Eigen::Index m = 0; m < k; ++m) {
      const double w0 = 2.0 * std::numbers::pi * p(2 * m), z = p(2 * m + 1);
      const double w = w0 * std::sqrt(1.0 - z * z);
      y += std::exp(-z * w0 * at) *
           (p(own + 2 * m) * std::cos(w * at) - p(own + 2 * m + 1) * std::sin(w * at));
    }
    return y;
  }

  std::vector<DecaySignal> Draw(Rng& rng, bool with_sigma = true) const {
    const Eigen::VectorXd p = Parameters();
    std::vector<DecaySignal> out;
    for (std::size_t j = 0; j < t.size(); ++j) {
      DecaySignal s;
      s.name = "signal" + std::to_string(j + 1);
      s.t = t[j];
      double noise = rng.Normal();
      for (const double at : t[j]) {
        s.value.push_back(Value(p, j, at) + sigma * noise);
        noise = rho * noise + std::sqrt(1.0 - rho * rho) * rng.Normal();
        if (with_sigma) s.sigma.push_back(sigma);
      }
      out.push_back(std::move(s));
    }
    return out;
  }

  // Standard deviations of f1, zeta1, f2, .. that no unbiased estimate from white noise can beat.
  Eigen::VectorXd Bound() const {
    const Eigen::VectorXd p = Parameters();
    Eigen::MatrixXd fisher = Eigen::MatrixXd::Zero(p.size(), p.size());
    for (std::size_t j = 0; j < t.size(); ++j) {
      for (const double at : t[j]) {
        Eigen::VectorXd g(p.size());
        for (Eigen::Index i = 0; i < p.size(); ++i) {
          Eigen::VectorXd up = p, down = p;
          const double h = 1e-6 * std::max(1e-2, std::abs(p(i)));
          up(i) += h;
          down(i) -= h;
          g(i) = (Value(up, j, at) - Value(down, j, at)) / (2.0 * h);
        }
        fisher += g * g.transpose() / (sigma * sigma);
      }
    }
    const Eigen::VectorXd scale = fisher.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * fisher * scale.asDiagonal();
    const Eigen::MatrixXd inverse = scale.asDiagonal() * scaled.inverse() * scale.asDiagonal();
    return inverse.diagonal().head(2 * static_cast<Eigen::Index>(modes.size())).cwiseSqrt();
  }
};

// Stamps from `from` to `to`, `step` apart.
inline std::vector<double> EvenStamps(double from, double to, double step) {
  std::vector<double> t;
  const auto n = static_cast<std::size_t>((to - from) / step + 1e-9);
  for (std::size_t i = 0; i <= n; ++i) t.push_back(from + static_cast<double>(i) * step);
  return t;
}

// One to three modes on four strobed marks. The weakest mode's largest amplitude over sigma is
// `ratio`: 10 is 20 dB, at the start; over the record the signal is weaker still.
inline PlantedDecay StrobedDecay(int modes, double ratio) {
  using C = std::complex<double>;
  const std::vector<PlantedMode> all = {
      {2.1, 0.012, {C(1.0, 0.3), C(0.6, 0.2), C(-0.4, 0.0), C(0.1, -0.2)}},
      {3.4, 0.02, {C(-0.3, 0.2), C(0.5, 0.1), C(1.0, -0.4), C(0.2, 0.0)}},
      {7.9, 0.008, {C(0.2, 0.0), C(-0.7, 0.4), C(0.3, 0.3), C(0.9, 0.2)}}};
  PlantedDecay d;
  d.modes.assign(all.begin(), all.begin() + modes);
  double weakest = 1e9;
  for (const PlantedMode& m : d.modes) {
    double largest = 0.0;
    for (const C& c : m.amplitude) largest = std::max(largest, std::abs(c));
    weakest = std::min(weakest, largest);
  }
  d.sigma = weakest / ratio;
  for (int j = 0; j < 4; ++j) d.t.push_back(EvenStamps(0.001 * j, 4.0, 0.01));
  d.level = {0.3, -0.2, 0.1, 0.0};
  d.slope = {0.05, 0.0, -0.1, 0.02};
  return d;
}

}  // namespace unfurl::correlate
