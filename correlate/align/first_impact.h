#pragma once

#include "correlate/observations.h"

namespace unfurl::correlate {

// When a mark's velocity first jumps by far more than noise and acceleration explain, on the
// record's clock; NaN: never [s].
double FirstImpact(const Observations& observations);

}  // namespace unfurl::correlate
