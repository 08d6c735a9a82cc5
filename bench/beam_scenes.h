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

// Section 4.2 of the paper: a steel rod of 6.35 mm between a crank at 150 rad/s and a sliding
// block, two revolutions; marks at the rod's start, middle and end.
inline constexpr double kRod = 0.3048, kCrank = 0.1524;       // [m]
inline constexpr double kRodMass = 0.076, kBlock = 0.038;     // [kg]
inline constexpr double kRodEI = 2.0e11 * 7.98113762732e-11;  // pi d^4 / 64 of 6.35 mm [N m^2]
inline constexpr double kSpeed = 150.0;                       // [rad/s]
data::Scene SliderCrank(const BeamChoice& choice);

// Two beams pinned in series to the ground, folded, a torsion spring at each pin, 1 s; mark "tip".
data::Scene TwoBeams(const BeamChoice& choice);

}  // namespace unfurl::bench
