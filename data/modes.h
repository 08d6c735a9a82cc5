#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "data/provenance.h"

namespace unfurl::data {

/// Natural frequencies and shapes of a scene, and the state that they were taken about
/// (docs/formats.md, "Modes").
struct ModesRecord {
  /// x [m], y [m], angle [rad] of a place, or their changes.
  using Pose = std::array<double, 3>;

  /// A natural motion of the scene.
  struct Mode {
    double frequency = 0.0;   ///< undamped; 0 for an unstable motion [Hz]
    double damping = 0.0;     ///< ratio, to first order [-]
    double growth = 0.0;      ///< of an unstable motion [1/s]
    std::vector<Pose> shape;  ///< by place; the largest displacement of the model is 1 m
    /// What the mesh leaves wrong of frequency [Hz] or growth [1/s]; NaN: not known.
    double error = std::numeric_limits<double>::quiet_NaN();
  };

  std::vector<std::string> places;  ///< bodies, segments of beams as BEAM/1.., marks
  std::vector<Pose> rest;           ///< of each place in that state
  std::vector<Mode> modes;          ///< unstable ones first, then by frequency

  /// The place that a mode moves most, into `places`; the first of several alike.
  std::size_t MovesMost(const Mode& mode) const;
};

inline constexpr char kModesSchema[] = "unfurl/modes";

/// By the ending: .h5, or .csv (which has no provenance). Throws Error for another.
void WriteModes(const std::string& path, const ModesRecord& record, const Provenance& provenance);
/// Of a .h5 file.
ModesRecord ReadModes(const std::string& path);

}  // namespace unfurl::data
