#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/random.h"
#include "measure/sensor.h"
#include "measure/spot.h"
#include "tests/measure/fixtures.h"

namespace unfurl::measure {

// A sensor of known noise that records Gaussian spots, and a finder with its background.
class SpotBench {
 public:
  explicit SpotBench(int bits = 12, const SpotOptions& options = {})
      : sensor_(ShippedLab({"sensor.bits=" + std::to_string(bits)}).sensor),
        background_(sensor_.format),
        finder_(sensor_.format, options),
        pixels_(static_cast<std::size_t>(sensor_.format.active)),
        counts_(sensor_.format.elements()) {
    sensor_.dark_drift = 0.0;
    Rng rng(99);
    for (int i = 0; i < 100; ++i) background_.Add(Record(rng));
  }

  const data::LabSensor& sensor() const { return sensor_; }
  double gain() const { return sensor_.format.electrons_per_count; }

  void Clear() { std::fill(pixels_.begin(), pixels_.end(), 0.0); }
  // A Gaussian, integrated over each pixel, of this many electrons in all.
  void AddGaussian(double centre, double sigma, double electrons) {
    for (std::size_t k = 0; k < pixels_.size(); ++k) {
      const double d = (static_cast<double>(k) - centre) / sigma;
      if (std::abs(d) > 9.0 + 1.0 / sigma) continue;
      const double half = 0.5 / sigma;
      pixels_[k] +=
          electrons * 0.5 * (std::erf((d + half) * M_SQRT1_2) - std::erf((d - half) * M_SQRT1_2));
    }
  }
  std::vector<double>& pixels() { return pixels_; }
  std::span<const std::uint16_t> Record(Rng& rng) {
    ReadOut(sensor_, pixels_, sensor_.dark_level + offset, rng, counts_);
    return counts_;
  }
  Spot Find(Rng& rng) { return finder_.Find(Record(rng), background_); }
  std::vector<Spot> FindAll(Rng& rng) {
    std::vector<Spot> spots(16);
    spots.resize(finder_.FindAll(Record(rng), background_, spots));
    return spots;
  }
  SpotFinder& finder() { return finder_; }
  const Background& background() const { return background_; }

  // The Cramer-Rao bound of the centre: Fisher sum over pixels with width, flux and background
  // free, by central differences of the model.
  double Bound(double centre, double sigma, double electrons) const {
    const auto model = [&](const Eigen::Vector4d& q, int k) {
      const double d = (k - q(0)) / q(1), half = 0.5 / q(1);
      return q(3) +
             q(2) * 0.5 * (std::erf((d + half) * M_SQRT1_2) - std::erf((d - half) * M_SQRT1_2));
    };
    const Eigen::Vector4d q(centre, sigma, electrons, 0.0);
    const Eigen::Vector4d step(1e-4, 1e-4, 1.0, 1.0);
    Eigen::Matrix4d fisher = Eigen::Matrix4d::Zero();
    const double fixed = sensor_.read_noise * sensor_.read_noise * 1.01 + gain() * gain() / 12.0;
    const int reach = static_cast<int>(std::ceil(6.0 * sigma)) + 4;
    for (int k = static_cast<int>(centre) - reach; k <= static_cast<int>(centre) + reach; ++k) {
      Eigen::Vector4d slope;
      for (int a = 0; a < 4; ++a) {
        Eigen::Vector4d up = q, down = q;
        up(a) += step(a);
        down(a) -= step(a);
        slope(a) = (model(up, k) - model(down, k)) / (2.0 * step(a));
      }
      fisher += slope * slope.transpose() / (fixed + std::max(0.0, model(q, k)));
    }
    return std::sqrt(fisher.inverse()(0, 0));
  }

  double offset = 0.0;

 private:
  data::LabSensor sensor_;
  Background background_;
  SpotFinder finder_;
  std::vector<double> pixels_;
  std::vector<std::uint16_t> counts_;
};

}  // namespace unfurl::measure
