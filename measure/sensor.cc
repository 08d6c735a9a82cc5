#include "measure/sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::measure {

namespace {

// `Patterned` adds gains and offsets; without it no line of their code is in the loop.
template <bool Patterned>
void ReadOutAs(const data::LabSensor& sensor, std::span<const double> active, double dark_level,
               Rng& rng, std::span<std::uint16_t> counts, const SensorPattern* pattern) {
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
    double electrons = signal + dark_level + noise;
    if constexpr (Patterned) electrons = electrons * pattern->gain[k] + pattern->offset[k];
    const double count = std::floor(electrons * per_count + 0.5);
    counts[k] = static_cast<std::uint16_t>(std::clamp(count, 0.0, full));
  }
}

}  // namespace

double DarkLevel(const data::LabSensor& sensor, double t, double phase) {
  if (sensor.dark_drift == 0.0) return sensor.dark_level;
  return sensor.dark_level +
         sensor.dark_drift *
             std::sin(2.0 * std::numbers::pi * t / sensor.dark_drift_period + phase);
}

SensorPattern DrawPattern(const data::LabSensor& sensor, Rng rng) {
  SensorPattern pattern;
  if (!sensor.has_pattern()) return pattern;
  const std::size_t elements = sensor.format.elements();
  const std::size_t active = static_cast<std::size_t>(sensor.format.active);
  const std::size_t first = sensor.format.first_active();
  if (sensor.nonuniformity > 0.0) {
    constexpr double kLeast = 0.1;  // of the mean: a dead pixel is another fault
    Rng draw = rng.Stream("response");
    for (std::size_t k = 0; k < active; ++k) {
      pattern.response.push_back(std::max(kLeast, 1.0 + sensor.nonuniformity * draw.Normal()));
    }
  }
  if (sensor.odd_gain != 0.0 || sensor.odd_offset != 0.0 || sensor.dark_nonuniformity > 0.0) {
    Rng draw = rng.Stream("offset");
    for (std::size_t k = 0; k < elements; ++k) {
      // Odd and even as the active pixels are counted.
      const bool odd = (k + first) % 2 == 1;
      pattern.gain.push_back(odd ? 1.0 + sensor.odd_gain : 1.0);
      pattern.offset.push_back((odd ? sensor.odd_offset : 0.0) +
                               sensor.dark_nonuniformity * draw.Normal());
    }
  }
  return pattern;
}

void Bloom(const data::LabSensor& sensor, std::span<double> electrons) {
  const double full = sensor.full_well;
  const double share = 0.5 * sensor.blooming;
  const std::size_t n = electrons.size();
  std::size_t first = 0;
  while (first < n && electrons[first] <= full) ++first;
  if (first == n) return;
  std::size_t last = n - 1;
  while (electrons[last] <= full) --last;
  // To the right and to the left: what is carried along fills what room there is. Full pixels keep
  // their excess until both ways are done, since it feeds both.
  double carried = 0.0;
  for (std::size_t k = first; k < n && (k <= last || carried > 0.0); ++k) {
    if (electrons[k] > full) {
      carried += share * (electrons[k] - full);
    } else {
      const double room = std::min(full - electrons[k], carried);
      electrons[k] += room;
      carried -= room;
    }
  }
  carried = 0.0;
  for (std::size_t k = last + 1; k-- > 0 && (k >= first || carried > 0.0);) {
    if (electrons[k] > full) {
      carried += share * (electrons[k] - full);
      electrons[k] = full;
    } else {
      const double room = std::min(full - electrons[k], carried);
      electrons[k] += room;
      carried -= room;
    }
  }
}

void ReadOut(const data::LabSensor& sensor, std::span<const double> active, double dark_level,
             Rng& rng, std::span<std::uint16_t> counts, const SensorPattern* pattern) {
  if (pattern != nullptr && !pattern->gain.empty()) {
    ReadOutAs<true>(sensor, active, dark_level, rng, counts, pattern);
  } else {
    ReadOutAs<false>(sensor, active, dark_level, rng, counts, nullptr);
  }
}

}  // namespace unfurl::measure
