#pragma once

#include <array>

#include "base/stream_median.h"
#include "data/tracks.h"

namespace unfurl::measure {

// The median standard deviations of usable samples along x, y and z, as the blocks of a
// reconstruction come: of the readings' errors, and of the calibration's [m].
class SigmaSummary {
 public:
  void Add(const data::Tracks& block);
  double readings(std::size_t axis) const { return readings_[axis].Get(); }
  double calibration(std::size_t axis) const { return calibration_[axis].Get(); }

 private:
  std::array<StreamMedian, 3> readings_, calibration_;
};

}  // namespace unfurl::measure
