#include "sim/methods/axial_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl::sim {
namespace {

// Of the free beam (and of one clamped at both ends, the stiffest), over sqrt(EI / (m L^3)).
constexpr double kFirstBending = 22.373;

}  // namespace

AxialWatch::AxialWatch(const Model& model) : model_(model), peaks_(model.beams.size()) {
  for (std::size_t b = 0; b < model.beams.size(); ++b) {
    const Model::Beam& beam = model.beams[b];
    if (beam.smooth >= 0) continue;
    const int first = beam.stations[0] >= 0 ? beam.stations[0] : beam.first;
    const int last = beam.stations[1] >= 0 ? beam.stations[1] : beam.first + beam.segments - 1;
    const double length = beam.segments * beam.segment_length;
    double mass = 0.0, softness = 0.0;
    for (int k = 0; k < beam.segments; ++k) mass += model.rigid_bodies.mass[beam.first + k];
    for (int e = first; e < last; ++e) {
      const double l = model.bending.length(e);
      const double EI = model.bending.shear_stiffness(e) * l * l * l / 12.0;
      const double rate = kFirstBending * std::sqrt(EI / (mass * length * length * length));
      elements_.push_back({e, static_cast<int>(b), l * l / EI, l, model.bending.axial_stiffness(e),
                           2.0 * M_PI / rate});
      softness += 1.0 / EI;
    }
    // Of a section that changes, with the mean of 1 / EI: less than it bears.
    if (last > first) peaks_[b].euler = M_PI * M_PI * (last - first) / (softness * length * length);
  }
}

void AxialWatch::Look(double t, const double* lambda, const double* state) {
  const StateIndex& i = model_.index;
  const double dt = t - t_;
  for (Element& e : elements_) {
    double force = -lambda[e.body];
    if (e.stiffness > 0.0) {
      const double dx = state[i.x(e.body + 1)] - state[i.x(e.body)];
      const double dy = state[i.y(e.body + 1)] - state[i.y(e.body)];
      // Along the element's axis, at the mean angle, as Bending has it: with a stiff axis the slack
      // of the deflection, dy^2 / (2 l), would be a force of its own.
      const double angle = 0.5 * (state[i.theta(e.body)] + state[i.theta(e.body + 1)]);
      force = e.stiffness * (std::cos(angle) * dx + std::sin(angle) * dy - e.length);
    }
    // The implicit Euler step of a first-order lag.
    e.lasting += (force - e.lasting) * dt / (e.period + dt);
    AxialPeak& peak = peaks_[e.beam];
    const double ratio = std::fabs(force) * e.ratio;
    if (ratio > peak.ratio) {
      peak.ratio = ratio;
      peak.time = t;
    }
    const double lasting = e.lasting * e.ratio;
    peak.tension = std::max(peak.tension, lasting);
    peak.compression = std::max(peak.compression, -lasting);
    peak.pressed = std::max(peak.pressed, -e.lasting);
    worst_ = std::max(worst_, std::fabs(lasting));
  }
  t_ = t;
}

std::string AxialWatch::Describe(std::size_t b) const {
  const AxialPeak& peak = peaks_[b];
  const Model::Beam& beam = model_.beams[b];
  const bool pressed = peak.compression > peak.tension;
  const double ratio = std::max(peak.tension, peak.compression);
  const int needed = static_cast<int>(std::ceil(beam.segments * std::sqrt(ratio / kWarn)));
  std::string text =
      fmt::format("beam '{}' is {} with P l^2 / EI = {:.3g} on its {} segments of length l",
                  beam.name, pressed ? "pressed" : "stretched", ratio, beam.segments);
  if (pressed && peak.pressed > peak.euler) {
    text += fmt::format(" ({:.3g} times its Euler load of {:.3g} N)", peak.pressed / peak.euler,
                        peak.euler);
  }
  return text + fmt::format("; use segments = {}, or model = \"kirchhoff\"", needed);
}

std::string AxialWatch::Complaint() const {
  std::size_t worst = 0;
  const auto ratio = [&](std::size_t b) {
    return std::max(peaks_[b].tension, peaks_[b].compression);
  };
  for (std::size_t b = 1; b < peaks_.size(); ++b) {
    if (ratio(b) > ratio(worst)) worst = b;
  }
  return Describe(worst) + fmt::format("; beyond {} the mesh does not resolve its bending", kStop);
}

std::vector<std::string> AxialWatch::Warnings() const {
  std::vector<std::string> warnings;
  for (std::size_t b = 0; b < peaks_.size(); ++b) {
    const AxialPeak& peak = peaks_[b];
    if (std::max(peak.tension, peak.compression) > kWarn) {
      warnings.push_back(Describe(b));
    } else if (peak.euler > 0.0 && peak.pressed > peak.euler) {
      warnings.push_back(fmt::format(
          "beam '{}' bears {:.3g} times its Euler load of {:.3g} N (pinned ends) for longer than a "
          "period of its first bending mode: it may buckle, which the mesh resolves; "
          "the direction depends on its imperfections",
          model_.beams[b].name, peak.pressed / peak.euler, peak.euler));
    }
  }
  return warnings;
}

}  // namespace unfurl::sim
