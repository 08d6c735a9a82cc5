#pragma once

#include <cstdint>
#include <span>

#include "base/random.h"
#include "data/lab.h"

namespace unfurl::measure {

// From electrons to counts, effect by effect in the order in which they arise; one that the lab
// sets to 0 (or false) draws nothing and changes nothing.

// The electronic offset under every element at time t, with its slow drift [e-].
double DarkLevel(const data::LabSensor& sensor, double t, double phase);

// One line: `active` holds the signal electrons of the active pixels, `dark_level` the offset;
// `counts` gets all elements in order of read-out.
void ReadOut(const data::LabSensor& sensor, std::span<const double> active, double dark_level,
             Rng& rng, std::span<std::uint16_t> counts);

}  // namespace unfurl::measure
