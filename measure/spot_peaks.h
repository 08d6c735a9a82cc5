#pragma once

#include <span>
#include <vector>

namespace unfurl::measure {

// A hill of a line that stands out of the noise.
struct SpotPeak {
  int summit = 0;
  int low = 0, high = 0;  // where it has fallen to its foot, or to the valley before the next hill
  float height = 0.0F;    // [count]
  float foot = 1.0F;      // over the height [-]
  bool touches_next = false;  // the valley before the next hill lies above the foot of one of them
};

/// What stands out of the noise.
struct PeakRule {
  float threshold = 0.0F;  // a summit rises above this [count]
  float variance = 0.0F;   // of a value without light [count^2]
  float gain = 1.0F;       // [e-/count], for the shot noise of a value
};

// The hills of `m`, left to right, in one pass. Two summits are two hills when the valley between
// them lies six sigmas below both.
void FindPeaks(std::span<const float> m, const PeakRule& rule, std::vector<SpotPeak>* peaks);

}  // namespace unfurl::measure
