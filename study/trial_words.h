#pragma once

#include <string>
#include <vector>

#include "correlate/fit/fit.h"
#include "data/fit.h"

namespace unfurl::study {

// What a fit says of each trial, as reasons of its record: residuals, noise, weights, events, clock
// and frame, gross errors, the model's own error. `apart`: one of them does not go with the others,
// and nothing else is blamed for what is left.
void AddTrialWords(const std::vector<std::string>& parameters,
                   const std::vector<correlate::FitTrial>& trials,
                   const correlate::FitResult& result, bool apart, data::FitRecord* record);

}  // namespace unfurl::study
