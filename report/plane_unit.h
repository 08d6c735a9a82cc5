#pragma once

#include "report/motion.h"
#include "report/page.h"

namespace unfurl::report {

// Places in metres of what is smaller than a decimetre are drawn in the unit that suits it, since
// ticks of "0.0005" are as wide as what they stand beside. Sets both axes' units; by how many of
// them a metre is to be multiplied, 1 where all stays.
double SetShortUnit(double extent, Axis* x, Axis* y);

// The drawing with all places in that unit.
Motion InShortUnit(Motion motion);
Paths InShortUnit(Paths paths);

}  // namespace unfurl::report
