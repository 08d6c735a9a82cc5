#include "measure/sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::measure {

double DarkLevel(const data::LabSensor& sensor, double t, double phase) {
  if (sensor.dark_drift == 0.0) return sensor.dark_level;
  return sensor.dark_level +
         sensor.dark_drift *
             std::sin(2.0 * std::numbers::pi * t / sensor.dark_drift_period + phase);
}

void ReadOut(const data::LabSensor& sensor, std::span<const double> active, double dark_level,
             Rng& rng, std::span<std::uint16_t> counts) {
  const data::LineFormat& f = sensor.format;
  const double per_count = 1.0 / f.electrons_per_count;
  const double full = f.full_scale();
  const std::size_t first = f.first_active();
  const double read_variance = sensor.read_noise * sensor.read_noise;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    const bool lit = k >= first && k < first + active.size();
    double signal = lit ? std::min(active[k - first], sensor.full_well) : 0.0;
    double variance = read_variance;
    if (sensor.shot_noise && signal > 0.0) {
      // Many electrons: shot and read noise are one normal draw (Poisson's own limit).
      if (signal > 30.0) {
        variance += signal;
      } else {
        signal = rng.Poisson(signal);
      }
    }
    const double noise = variance > 0.0 ? std::sqrt(variance) * rng.Normal() : 0.0;
    const double count = std::floor((signal + dark_level + noise) * per_count + 0.5);
    counts[k] = static_cast<std::uint16_t>(std::clamp(count, 0.0, full));
  }
}

}  // namespace unfurl::measure
