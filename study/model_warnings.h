#pragma once

#include "correlate/fit/fit.h"
#include "data/fit.h"

namespace unfurl::study {

/// What the simulator doubts of its own runs near the estimate (a joint beyond the points of its
/// table, a mesh too coarse for what pulls at it, energy out of balance) among the record's
/// reasons: a fit is no better than the runs that it rests on. Of each trial's finest rung.
void AddModelWarnings(const correlate::FitProblem& problem, const correlate::FitResult& result,
                      data::FitRecord* record);

}  // namespace unfurl::study
