#include "correlate/align/nuisance.h"

#include <fmt/format.h>

#include <charconv>
#include <stdexcept>
#include <string_view>

#include "base/pose.h"

namespace unfurl::correlate {

std::string Nuisance::Name() const {
  switch (kind) {
    case Kind::kRotation:
      return fmt::format("frame rotation about {}", "xyz"[index]);
    case Kind::kShift:
      return fmt::format("frame shift along {}", "xyz"[index]);
    case Kind::kOffset:
      return "time offset";
    case Kind::kDrift:
      return "clock drift";
    case Kind::kDraw:
      break;
  }
  return fmt::format("calibration draw {}", index + 1);
}

const char* Nuisance::Unit() const {
  switch (kind) {
    case Kind::kRotation:
      return "rad";
    case Kind::kShift:
      return "m";
    case Kind::kOffset:
      return "s";
    case Kind::kDrift:
    case Kind::kDraw:
      break;
  }
  return "1";
}

std::vector<Nuisance> Nuisances(const RegistrationOptions& options, int shared_rank) {
  std::vector<Nuisance> all;
  if (options.fit_frame) {
    for (Nuisance::Kind kind : {Nuisance::Kind::kRotation, Nuisance::Kind::kShift}) {
      for (int axis = 0; axis < 3; ++axis) all.push_back({kind, axis});
    }
  }
  if (options.fit_offset) all.push_back({Nuisance::Kind::kOffset, 0});
  if (options.fit_drift) all.push_back({Nuisance::Kind::kDrift, 0});
  for (int i = 0; i < shared_rank; ++i) all.push_back({Nuisance::Kind::kDraw, i});
  return all;
}

Nuisance NuisanceNamed(const std::string& name) {
  RegistrationOptions all;
  all.fit_drift = true;
  for (const Nuisance& n : Nuisances(all, 0)) {
    if (n.Name() == name) return n;
  }
  constexpr std::string_view kDraw = "calibration draw ";
  int number = 0;
  if (name.starts_with(kDraw)) {
    std::from_chars(name.data() + kDraw.size(), name.data() + name.size(), number);
  }
  if (number < 1) throw std::invalid_argument("no unknown of a registration: " + name);
  return {Nuisance::Kind::kDraw, number - 1};
}

double ValueOf(const Nuisance& nuisance, const RegistrationFit& fit) {
  switch (nuisance.kind) {
    case Nuisance::Kind::kRotation:
      return VectorFromRotation(fit.at.X_WM.linear())(nuisance.index);
    case Nuisance::Kind::kShift:
      return (fit.at.X_WM * fit.centroid_M)(nuisance.index);
    case Nuisance::Kind::kOffset:
      return fit.at.offset;
    case Nuisance::Kind::kDrift:
      return fit.at.drift;
    case Nuisance::Kind::kDraw:
      break;
  }
  return fit.at.z(nuisance.index);
}

}  // namespace unfurl::correlate
