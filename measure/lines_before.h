#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "measure/spot.h"

namespace unfurl::measure {

// What a sensor may have kept of earlier lines: a small and constant share of each spot is read
// with the next line, at its place (image lag). Where a line's own light is missing that is the
// brightest, in all cameras at once, and meets in a point where another mark is. Of one camera.
class LinesBefore {
 public:
  static constexpr std::size_t kMost = 8;  // spots that are remembered

  // `least_share`: taken for what may be kept as long as the record shows no more and no less [-].
  explicit LinesBefore(double least_share) : share_(least_share), least_share_(least_share) {}

  // Lines from elsewhere follow.
  void Forget() { count_ = 0; }
  // Whether earlier light explains a spot: it stands at the place of one and is no brighter than
  // the sensor may have kept of that.
  bool Explain(const Spot& spot) const;
  // Its spots become earlier light, the brightest first. What was before is kept on, weaker: one
  // line in between may have been dark.
  void Add(std::span<const Spot> spots);

  // What a line whose own light stands apart shows of the line before, which was added last: the
  // spot at the place of its brightest, or that there is none as bright as `least(width)`.
  void Learn(std::span<const Spot> spots, const SpotFinder& finder);
  // Takes what was learned for the sensor.
  void Conclude();
  double share() const { return share_; }  // of a spot, that may be kept [-]

 private:
  struct Light {
    double u_px = 0.0, width_px = 0.0, flux = 0.0;
  };
  static bool SamePlace(const Spot& spot, const Light& light);

  double share_, least_share_;
  std::size_t count_ = 0;
  std::array<Light, kMost> light_;
  std::vector<double> seen_, bound_;  // by line: what was kept, 0 where unseen; not more than [-]
};

}  // namespace unfurl::measure
