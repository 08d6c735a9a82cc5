#pragma once

#include <vector>

#include "correlate/fit/evaluator.h"
#include "correlate/fit/fit.h"
#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/screening.h"

namespace unfurl::correlate {

// A motion that repeats itself lies nearly as well beside a record that is taken to begin a swing
// earlier or later. Which swing it is shows only when the parameters are fitted to each; where the
// record does not show the release, and a parameter may make up for it, not even then.

// Where else in time the trials may lie beside the model at `theta`, by what an alignment asks: all
// trials earlier or later by their nearest other place, and, of several trials, each alone. `from`
// and `point` are of where they lie now. None where all clocks are known.
std::vector<Candidate> OtherPlaces(const FitProblem& problem, const FitOptions& options,
                                   const Candidate& from, const std::vector<double>& theta,
                                   const ReducedProblem::Point& point, Evaluator& evaluator);

// Opens the intervals, to the side where it lies, of each parameter whose value at another offset
// that explains the data as well lies outside: it is determined in combination with the offset
// only.
void OpenByOtherClocks(const FitProblem& problem, FitResult* r);

}  // namespace unfurl::correlate
