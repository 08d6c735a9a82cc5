#pragma once

#include "correlate/fit/fit.h"
#include "study/trials_apart.h"

namespace unfurl::study {

/// Of a fit that does not explain its data: whether it would with another gain, bias or delay of
/// one instrument of which nothing was said. Each is set free in turn and fitted from the
/// estimate; one that explains the data is named with its value. As many fits as there are such
/// numbers, without profiles, on threads of this machine; none where all is explained.
TrialsApart FindInstrumentsApart(const correlate::FitProblem& problem,
                                 const correlate::FitOptions& options,
                                 const correlate::FitResult& r);

}  // namespace unfurl::study
