#pragma once

#include <vector>

#include "correlate/fit/evaluator.h"
#include "correlate/fit/fit.h"

namespace unfurl::correlate {

// Where in time the trials may lie beside the model at the start's values. An alignment keeps the
// best place alone; of a start that is some per cent off this may be another swing.

// Options of ways that begin at such places, each with a horizon that grows from a part of the
// record over which the start explains what an alignment asks of one history: of the longer part
// first, and of one part first the clocks as they stand (the release at 0, or at what is stated),
// then the better explained. None where no offset is sought or stages are ordered. Costs a run of
// each trial and one for each horizon.
std::vector<FitOptions> OtherBeginnings(const FitProblem& problem, const FitOptions& options,
                                        Evaluator& evaluator);

}  // namespace unfurl::correlate
