#pragma once

#include "correlate/fit/fit.h"
#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

// Verdict and reason of each parameter, from its standard errors, its profile and the sensitivities
// at the estimate; fills in sigma_alone and imitated.
//
// A parameter is known when its 95% interval, the model's error added, stays within KnownWithin of
// the value. One that is not, but would be were the others known, is determined only in
// combination: with those parameters, or with what frame, time offset or calibration can imitate.
void Judge(const FitProblem& problem, const ReducedProblem& reduced,
           const ReducedProblem::Point& point, FitResult* result);

}  // namespace unfurl::correlate
