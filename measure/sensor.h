#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/random.h"
#include "data/lab.h"

namespace unfurl::measure {

// From electrons to counts, effect by effect in the order in which they arise; one that the lab
// sets to 0 (or false) draws nothing, changes nothing and costs nothing.

// The electronic offset under every element at time t, with its slow drift [e-].
double DarkLevel(const data::LabSensor& sensor, double t, double phase);

// What is fixed in one sensor, drawn once. Empty vectors: all alike.
struct SensorPattern {
  std::vector<double> response;  // of each active pixel to light, relative [-]
  std::vector<double> gain;      // of each element's register, relative [-]
  std::vector<double> offset;    // of each element [e-]
};
SensorPattern DrawPattern(const data::LabSensor& sensor, Rng rng);

// What full pixels cannot hold goes to their neighbours, half to either side and on until it finds
// room; of the excess a share `sensor.blooming` does so, the rest is drained. `electrons` are those
// of the active pixels.
void Bloom(const data::LabSensor& sensor, std::span<double> electrons);

// One line: `active` holds the signal electrons of the active pixels, `dark_level` the offset;
// `counts` gets all elements in order of read-out. `pattern` gives gains and offsets.
void ReadOut(const data::LabSensor& sensor, std::span<const double> active, double dark_level,
             Rng& rng, std::span<std::uint16_t> counts, const SensorPattern* pattern = nullptr);

}  // namespace unfurl::measure
