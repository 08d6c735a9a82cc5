#pragma once

#include <nlohmann/json_fwd.hpp>
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

// For the terminal, and for --json.
std::string FitText(const data::FitRecord& record, double seconds);
nlohmann::ordered_json FitJson(const data::FitRecord& record, const std::string& output,
                               double seconds);

}  // namespace unfurl::study
