#pragma once

#include <span>

#include "measure/correction.h"

namespace unfurl::measure {

// How many directions the corrections' errors add to what samples share.
int CorrectionDirections(std::span<const Correction> corrections);

}  // namespace unfurl::measure
