#include "correlate/align/nuisance.h"

#include <fmt/format.h>

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
    case Kind::kOwn:
      return own_name;
    case Kind::kDraw:
      break;
  }
  return fmt::format("calibration draw {}", index + 1);
}

std::string Nuisance::Unit() const {
  switch (kind) {
    case Kind::kRotation:
      return "rad";
    case Kind::kShift:
      return "m";
    case Kind::kOffset:
      return "s";
    case Kind::kOwn:
      return own_unit;
    case Kind::kDrift:
    case Kind::kDraw:
      break;
  }
  return "1";
}

std::vector<Nuisance> Nuisances(const RegistrationOptions& options,
                                const Observations& observations) {
  std::vector<Nuisance> all;
  if (options.fit_frame) {
    for (Nuisance::Kind kind : {Nuisance::Kind::kRotation, Nuisance::Kind::kShift}) {
      for (int axis = 0; axis < 3; ++axis) all.push_back({kind, axis});
    }
  }
  if (options.fit_offset) all.push_back({Nuisance::Kind::kOffset, 0});
  if (options.fit_drift) all.push_back({Nuisance::Kind::kDrift, 0});
  int own = 0;
  for (const auto& kind : observations.others) {
    if (!options.with_others) break;
    for (const ResidualKind::Unknown& u : kind->unknowns()) {
      all.push_back({Nuisance::Kind::kOwn, own++, u.name, u.unit});
    }
  }
  for (int i = 0; i < observations.shared_rank; ++i) all.push_back({Nuisance::Kind::kDraw, i});
  return all;
}

std::vector<std::string> NamesOf(const std::vector<Nuisance>& nuisances) {
  std::vector<std::string> names;
  names.reserve(nuisances.size());
  for (const Nuisance& n : nuisances) names.push_back(n.Name());
  return names;
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
    case Nuisance::Kind::kOwn:
      return fit.at.own(nuisance.index);
    case Nuisance::Kind::kDraw:
      break;
  }
  return fit.at.z(nuisance.index);
}

}  // namespace unfurl::correlate
