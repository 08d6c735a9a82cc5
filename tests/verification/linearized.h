#pragma once

#include <vector>

#include "sim/dynamics/dynamics.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// Natural frequencies [rad/s], lowest first, of the motion transverse to straight beams along x, at
// rest in the model's initial state: accelerations of y and theta are linear in them there, so
// differences of the right side give the dynamic matrix. Constraints may tie the y of a place
// (pins); rigid motions and what constraints forbid (eigenvalues below `rigid` [1/s^2]) are left
// out.
std::vector<double> TransverseFrequencies(const Model& model, double rigid = 1.0);

}  // namespace unfurl::sim
