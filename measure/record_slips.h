#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "measure/triangulate.h"

namespace unfurl::measure {

/// A slip in how a record names its cameras or lines, by what it does to the readings.
struct RecordSlip {
  std::string what;    ///< "the readings of cameras 'a' and 'b' are exchanged"; empty: none
  std::string remedy;  ///< what to write instead
  /// Whether there is one.
  bool found() const { return !what.empty(); }
};

/// First reading of each camera in a flash of one mark; NaN: none [px].
using FlashReadings = std::array<double, CameraBank::kMaxCameras>;

/// Whether flashes that do not meet in points do so, twenty times as closely, once two cameras are
/// exchanged, all are moved on by some places, or rows are read from their other ends. Of flashes
/// that four cameras see; of others nothing is told.
RecordSlip FindCameraSlip(std::span<const FlashReadings> flashes, const Triangulator& triangulator);

/// Some lines that followed each other: what they are named, and how bright they were.
struct NamedLines {
  double t = 0.0;           ///< of the first [s]
  std::vector<int> slot;    ///< index into names
  std::vector<float> flux;  ///< of the brightest spot, median of the cameras [count]
};

/// Whether, from some stretch to the last, lines named dark show a light and those of another slot
/// none. `names` of the slots; `dark` those of them that are.
RecordSlip FindSlotSlip(std::span<const NamedLines> stretches, std::span<const std::string> names,
                        const std::vector<bool>& dark);

}  // namespace unfurl::measure
