#include "measure/exposer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace unfurl::measure {

namespace {

Disc DiscOf(const data::LabDisc& d) {
  return {.centre = d.centre, .normal = d.normal, .radius = d.radius};
}

}  // namespace

double MeanFlicker(double depth, double frequency, double phase, double from, double until) {
  const double omega = 2.0 * std::numbers::pi * frequency;
  const double half = 0.5 * omega * (until - from);
  const double sinc = std::abs(half) < 1e-8 ? 1.0 : std::sin(half) / half;
  return 1.0 + depth * std::sin(0.5 * omega * (from + until) + phase) * sinc;
}

int ResidualMemory(const data::LabSensor& sensor) {
  constexpr double kNothing = 1e-6;  // of a signal: less than a tenth of a count of 16 bits
  if (sensor.residual <= 0.0) return 0;
  return static_cast<int>(std::ceil(std::log(kNothing) / std::log(sensor.residual)));
}

Exposer::Exposer(const data::Lab& lab, const VirtualRig& rig) : lab_(lab), rig_(rig) {
  for (const LensCamera& camera : rig.cameras) {
    painters_.emplace_back(camera.sensor.blur / camera.sensor.pitch);
  }
  if (lab.led.half_angle > 0.0) {
    led_exponent_ = -std::numbers::ln2 / std::log(std::cos(lab.led.half_angle));
  }
  for (const data::LabReflection& r : lab.reflections) mirrors_.push_back(DiscOf(r.disc));
  ambient_.resize(rig.cameras.size());
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const LensCamera& camera = rig.cameras[c];
    const auto n = static_cast<std::size_t>(camera.sensor.pixels);
    for (std::size_t k = 0; k < n && lab.ambient.level > 0.0; ++k) {
      const double along = 2.0 * static_cast<double>(k) / static_cast<double>(n - 1) - 1.0;
      ambient_[c].push_back(lab.ambient.level / lab.strobe.line_rate *
                            (1.0 + lab.ambient.slope * along));
    }
    remains_.emplace_back(lab.SensorOf(c).residual > 0.0 ? n : 0, 0.0);
    for (const data::LabLamp& lamp : lab.lamps) {
      lamps_.emplace_back(n, 0.0);
      SpotLight spot;
      if (TraceSpot(camera, lamp.position, &spot)) {
        painters_[c].Add(spot, lamp.brightness * rig.flash_electrons, lamps_.back());
      }
    }
  }
}

void Exposer::Forget() {
  for (std::vector<double>& charge : remains_) std::fill(charge.begin(), charge.end(), 0.0);
}

void Exposer::AddLed(std::size_t c, const Led& led, double electrons, double t) {
  const LensCamera& camera = rig_.cameras[c];
  const double share = electrons / static_cast<double>(led.instants.size());
  const auto towards = [&](const Eigen::Vector3d& p_W, const Eigen::Vector3d& target) {
    if (led_exponent_ == 0.0) return 1.0;
    const double cosine = led.axis.dot((target - p_W).normalized());
    return cosine > 0.0 ? std::pow(cosine, led_exponent_) : 0.0;
  };
  LightPath path;
  if (!lab_.occluders.empty()) {
    occluders_.clear();
    for (const data::LabOccluder& o : lab_.occluders) {
      if (t >= o.from && t <= o.until) occluders_.push_back(DiscOf(o.disc));
    }
    path.occluders = occluders_;
  }
  SpotLight spot;
  const Eigen::Vector3d slit = camera.X_WC.translation();
  for (const Eigen::Vector3d& p_W : led.instants) {
    path.mirror = nullptr;
    if (TraceSpot(camera, p_W, &spot, path.occluders.empty() ? nullptr : &path)) {
      painters_[c].Add(spot, share * towards(p_W, slit), pixels_);
    }
    for (std::size_t m = 0; m < mirrors_.size(); ++m) {
      path.mirror = &mirrors_[m];
      if (!TraceSpot(camera, p_W, &spot, &path)) continue;
      painters_[c].Add(
          spot, share * lab_.reflections[m].reflectance * towards(p_W, mirrors_[m].Mirrored(slit)),
          pixels_);
    }
  }
}

void Exposer::AddAmbient(std::size_t c, const Line& line) {
  const double half = 0.5 / lab_.strobe.line_rate;
  const double from = line.t - half, until = line.t + half;
  const auto add = [&](const std::vector<double>& light, double depth, double frequency) {
    const double now = MeanFlicker(depth, frequency, line.mains_phase, from, until);
    for (std::size_t k = 0; k < pixels_.size(); ++k) pixels_[k] += now * light[k];
  };
  if (!ambient_[c].empty()) add(ambient_[c], lab_.ambient.flicker, lab_.ambient.frequency);
  for (std::size_t i = 0; i < lab_.lamps.size(); ++i) {
    add(lamps_[c * lab_.lamps.size() + i], lab_.lamps[i].flicker, lab_.lamps[i].frequency);
  }
}

void Exposer::Collect(std::size_t c, const Line& line) {
  pixels_.assign(static_cast<std::size_t>(rig_.cameras[c].sensor.pixels), 0.0);
  for (const Led& led : line.leds) AddLed(c, led, line.electrons, line.t);
  if (!ambient_[c].empty() || !lab_.lamps.empty()) AddAmbient(c, line);
  const std::vector<double>& response = rig_.patterns[c].response;
  for (std::size_t k = 0; k < response.size(); ++k) pixels_[k] *= response[k];
  const data::LabSensor& sensor = lab_.SensorOf(c);
  if (!remains_[c].empty()) {
    std::vector<double>& remains = remains_[c];
    const double stays = sensor.residual;
    for (std::size_t k = 0; k < pixels_.size(); ++k) {
      const double charge = pixels_[k] + remains[k];
      remains[k] = stays * charge;
      pixels_[k] = charge - remains[k];
    }
  }
  if (sensor.blooming > 0.0) Bloom(sensor, pixels_);
}

void Exposer::Read(std::size_t c, double dark_level, Rng rng, std::span<std::uint16_t> counts) {
  ReadOut(lab_.SensorOf(c), pixels_, dark_level, rng, counts, &rig_.patterns[c]);
}

}  // namespace unfurl::measure
