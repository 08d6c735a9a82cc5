#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "correlate/modes/ambient.h"
#include "tests/correlate/chain.h"

namespace unfurl::correlate {

// A structure, how it is measured, and how often intervals of what was found hold the truth.
struct AmbientCase {
  std::string name;
  DrivenStructure structure;
  double step;  // [s]
  int samples;
  std::vector<int> coordinates;
  DrivenStructure::Output output;
  double noise;         // over each signal's RMS [-]
  double corner = 0.0;  // of the forces [Hz]; 0: white
};

struct AmbientTally {
  std::vector<int> found, frequency, damping;  // by mode; of those found, held by the interval
  // `hidden`: neither found nor told to be left out; `needless`: records said to leave out
  // something though all was found
  int hidden = 0, needless = 0, spurious = 0, doubts = 0, harmonic = 0, of_record = 0, shapes = 0,
      shape_parts = 0;
};

// The planted mode that a found one is: nearest in frequency, and alike in shape; -1: none.
inline int PlantedAs(const AmbientCase& c, const Mode& mode) {
  int best = -1;
  double most = 0.5;  // MAC
  for (std::size_t k = 0; k < c.structure.frequency().size(); ++k) {
    Eigen::VectorXcd shape(static_cast<Eigen::Index>(c.coordinates.size()));
    for (Eigen::Index j = 0; j < shape.size(); ++j) {
      shape(j) = c.structure.shapes()(c.coordinates[static_cast<std::size_t>(j)],
                                      static_cast<Eigen::Index>(k));
    }
    const double f = c.structure.frequency()[k];
    // Nearer than any two of the cases' chains are to each other.
    if (std::abs(mode.frequency - f) > 0.05 * f) continue;
    const double mac = ModalAssurance(shape, mode.shape);
    if (mac > most) best = static_cast<int>(k), most = mac;
  }
  return best;
}

inline AmbientTally Tally(const AmbientCase& c, int runs, std::uint64_t seed) {
  constexpr double kSigmas = 1.96;
  const std::size_t n = c.structure.frequency().size();
  AmbientTally out;
  out.found.assign(n, 0);
  out.frequency = out.damping = out.found;
  for (int r = 0; r < runs; ++r) {
    Rng rng(seed + static_cast<std::uint64_t>(r));
    const AmbientFit fit = IdentifyAmbientModes(
        c.structure.Draw(rng, c.step, c.samples, c.coordinates, c.output, c.noise, c.corner));
    out.of_record += fit.doubts.empty() ? 0 : 1;
    std::vector<bool> taken(n, false);
    for (const AmbientMode& m : fit.modes) {
      out.doubts += m.doubts.empty() ? 0 : 1;
      out.harmonic += m.harmonic ? 1 : 0;
      const int as = PlantedAs(c, m.mode);
      if (as < 0 || taken[static_cast<std::size_t>(as)]) {
        ++out.spurious;
        continue;
      }
      const auto k = static_cast<std::size_t>(as);
      taken[k] = true;
      ++out.found[k];
      const double f = m.mode.frequency - c.structure.frequency()[k];
      const double z = m.mode.damping - c.structure.damping()[k];
      out.frequency[k] += std::abs(f) < kSigmas * m.mode.frequency_sigma ? 1 : 0;
      out.damping[k] += std::abs(z) < kSigmas * m.mode.damping_sigma ? 1 : 0;
      for (std::size_t j = 0; j < c.coordinates.size(); ++j) {
        const auto at = static_cast<Eigen::Index>(j), mode = static_cast<Eigen::Index>(k);
        Eigen::Index largest = 0;
        m.mode.shape.cwiseAbs().maxCoeff(&largest);
        if (at == largest) continue;
        const auto& S = c.structure.shapes();
        const double truth =
            S(c.coordinates[j], mode) / S(c.coordinates[static_cast<std::size_t>(largest)], mode);
        const auto& sigma = m.mode.shape_sigma;
        out.shapes += std::abs(m.mode.shape(at).real() - truth) < kSigmas * sigma(0, at) ? 1 : 0;
        out.shapes += std::abs(m.mode.shape(at).imag()) < kSigmas * sigma(1, at) ? 1 : 0;
        out.shape_parts += 2;
      }
    }
    const bool all = std::all_of(taken.begin(), taken.end(), [](bool t) { return t; });
    out.needless += all && !fit.left_out.empty() ? 1 : 0;
    for (std::size_t k = 0; k < n; ++k) {
      if (taken[k]) continue;
      const double f = c.structure.frequency()[k];
      // What no order holds is known as roughly as its width.
      const double width = std::max(0.05, c.structure.damping()[k]) * f;
      const bool told =
          std::any_of(fit.left_out.begin(), fit.left_out.end(),
                      [&](const AmbientSwing& s) { return std::abs(s.frequency - f) < width; });
      out.hidden += told ? 0 : 1;
    }
  }
  return out;
}

}  // namespace unfurl::correlate
