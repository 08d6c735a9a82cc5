#pragma once

#include <string>

#include "correlate/fit/fit.h"

namespace unfurl::study {

// What the model does between the samples of a trial, and what the errors rest on there; empty:
// what the samples show. `of`: " of trial 2", or nothing.
std::string BetweenWords(const correlate::TrialResult& trial, const std::string& of);

}  // namespace unfurl::study
