#pragma once

#include <string>
#include <vector>

#include "data/tracks.h"

namespace unfurl::data {

// Tracks laid on frames of one rate, for formats that know nothing else: sample `frame` of a mark
// is at start + frame / rate + delay of that mark.
struct TracksGrid {
  double start = 0.0;         // of the first frame [s]
  double step = 0.0;          // between frames [s]
  std::vector<double> delay;  // by mark, in [0, step) [s]
  std::size_t frames = 0;
  std::vector<std::vector<std::ptrdiff_t>> sample;  // by mark and frame; -1: none
  bool regular = false;  // every stamp lies on the grid to within a thousandth of the step
  double Time(std::size_t mark, std::size_t frame) const {
    return start + step * static_cast<double>(frame) + delay[mark];
  }
};

// Never more than one sample to a frame; where stamps do not lie on a grid, `regular` is false and
// the samples are left out.
TracksGrid GridOf(const Tracks& tracks);

}  // namespace unfurl::data
