#pragma once

#include <string>

#include "correlate/fit/choose_tolerance.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "data/study.h"
#include "study/trials_apart.h"

namespace unfurl::study {

// What a fit found as a record for the file, with the whole verdict in words. `apart`: what was
// found of trials that do not go together, or could not be aligned.
data::FitRecord RecordOf(const data::Study& study, const correlate::FitProblem& problem,
                         const correlate::FitResult& result, const TrialsApart& apart = {});

// Says which tolerance the simulator ran with, trial by trial, where it was chosen by the data.
void AddTolerances(const std::vector<correlate::ToleranceChoice>& choices, data::FitRecord* record);

}  // namespace unfurl::study
