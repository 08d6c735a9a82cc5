#pragma once

#include <vector>

#include "data/beam_section.h"
#include "sim/model/aligned.h"

namespace unfurl::sim {

// What KirchhoffShapes has in closed form for a uniform beam, of one whose section changes: slopes
// (curvatures) and angles of the lowest modes of the free beam, and of the shapes in which a moment
// or force at an end, held by the beam's own inertia, bends it. All are a moment over the bending
// stiffness; the modes' moments are sums of x^2 (1 - x)^2 P_k(2 x - 1), which vanish with their
// slopes at both free ends, by Rayleigh and Ritz.
class TaperedShapes {
 public:
  TaperedShapes(const data::BeamSection& section, int modes);

  // The shapes in this order: of a moment and a force at the start, of both at the end, then modes.
  enum Static { kMomentAtStart, kForceAtStart, kMomentAtEnd, kForceAtEnd, kFirstMode };
  double Slope(int shape, double x) const;
  double Angle(int shape, double x) const;  // its mean is zero

 private:
  double Moment(int shape, double x) const;
  double Integral(int shape, double to, bool mean) const;
  void FindModes(int modes);

  data::BeamSection section_;
  std::vector<std::vector<double>> statics_;  // by shape: polynomial in the distance from its end
  std::vector<std::vector<double>> modes_;    // by mode: coefficients of the sum
  std::vector<double> means_;                 // by shape, of the angle from the start on
  Array x_, weight_;                          // that integrate them
};

}  // namespace unfurl::sim
