#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "correlate/fit.h"
#include "data/fit.h"
#include "data/study.h"

namespace unfurl::cli {

// What a fit found as a record for the file, with the whole verdict in words.
data::FitRecord RecordOf(const data::Study& study, const correlate::FitProblem& problem,
                         const correlate::FitResult& result);

// For the terminal, and for --json.
std::string FitText(const data::FitRecord& record, double seconds);
nlohmann::ordered_json FitJson(const data::FitRecord& record, const std::string& output,
                               double seconds);

}  // namespace unfurl::cli
