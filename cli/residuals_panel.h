#pragma once

#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "report/page.h"

namespace unfurl::cli {

// What a fit's residuals show: autocorrelation by trial, over time
// and against a normal distribution by mark, the noise found in them, and the samples
// that were given less weight.
void AddResiduals(const correlate::FitProblem& problem, const correlate::FitResult& result,
                  const data::FitRecord& record, report::Page* page);

}  // namespace unfurl::cli
