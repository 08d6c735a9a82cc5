#pragma once

#include <string>

#include "correlate/fit/choose_tolerance.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "data/study.h"

namespace unfurl::study {

// What a fit found as a record for the file, with the whole verdict in words.
data::FitRecord RecordOf(const data::Study& study, const correlate::FitProblem& problem,
                         const correlate::FitResult& result);

// Says which tolerance the simulator ran with, trial by trial, where it was chosen by the data.
void AddTolerances(const std::vector<correlate::ToleranceChoice>& choices, data::FitRecord* record);

}  // namespace unfurl::study
