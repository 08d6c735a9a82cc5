#pragma once

#include <optional>
#include <string>

#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "data/fit.h"
#include "data/run.h"

namespace unfurl::cli {

// What the page of a fit shows.
struct FitPageInput {
  const data::FitRecord& record;
  const correlate::FitProblem& problem;
  const correlate::FitResult& result;
  const correlate::Comparison& comparison;  // at the estimate; without errors: none
  const std::optional<data::Run>& motion;   // of the scene there
  data::Provenance provenance;
};
void WriteFitPage(const std::string& path, const FitPageInput& input);

}  // namespace unfurl::cli
