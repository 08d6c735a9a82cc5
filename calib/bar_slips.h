#pragma once

#include <cstddef>
#include <vector>

#include "calib/check.h"
#include "calib/observations.h"
#include "calib/slips.h"
#include "measure/triangulate.h"

namespace unfurl::calib {

// Whether readings of a bar, two points for each placement, fit a rig after all once one camera's
// two ends are exchanged, two cameras' columns are, a row is read from its other end, or the second
// ends belong to the placement before or after: three quarters of the placements are then found of
// the stated length, where as written less than a quarter are.
Slip FindBarSlip(const measure::Triangulator& triangulator, const Observations& data,
                 const std::vector<std::size_t>& match, const Bar& bar);

// Whether three placements or more, as they were found, are so many times too short or too long
// that the length is stated in another unit.
Slip FindBarUnitSlip(const std::vector<CheckedPoint>& placements, const Bar& bar);

}  // namespace unfurl::calib
