#pragma once

#include <string>

#include "data/scene.h"

// The two scenes on which beams are measured, made for either model of a beam.
namespace unfurl::bench {

struct BeamChoice {
  data::BeamModel model;
  int size;  // segments or modes
  std::string Name() const;
};

// Section 4.2 of the paper: a steel rod of 6.35 mm on a crank at 150 rad/s, two revolutions; marks
// at the rod's start, middle and end.
inline constexpr double kRod = 0.3048;  // [m]
data::Scene SliderCrank(const BeamChoice& choice);

// Two beams pinned in series to the ground, folded, a torsion spring at each pin, 1 s; mark "tip".
data::Scene TwoBeams(const BeamChoice& choice);

}  // namespace unfurl::bench
