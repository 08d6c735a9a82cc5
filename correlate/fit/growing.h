#pragma once

#include <vector>

#include "correlate/fit/fit.h"

namespace unfurl::correlate {

// A model of many swings whose pace is off by a few per cent lies beside its record nowhere; over
// its first swings it does.

// Options whose horizon begins with a half of the shortest record, a quarter, an eighth.. (those
// that hold enough to be led by) and grows by 1.6 to the whole. None where stages are ordered.
// `all`: before them the whole at once, after them the shortest that holds enough.
std::vector<FitOptions> GrowingHorizons(const FitProblem& problem, const FitOptions& options,
                                        bool all = false);

}  // namespace unfurl::correlate
