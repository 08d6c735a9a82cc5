#pragma once

#include <string>

#include "cli/comparison.h"
#include "correlate/fit.h"
#include "data/fit.h"

namespace unfurl::cli {

// What the page of a fit shows.
struct FitPageInput {
  const data::FitRecord& record;
  const correlate::FitProblem& problem;
  const correlate::FitResult& result;
  const Comparison& comparison;  // at the estimate; without errors: none
  data::Provenance provenance;
};
void WriteFitPage(const std::string& path, const FitPageInput& input);

}  // namespace unfurl::cli
