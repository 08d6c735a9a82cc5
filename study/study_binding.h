#pragma once

#include <memory>
#include <string>
#include <vector>

#include "correlate/fit/choose_tolerance.h"
#include "correlate/fit/fit.h"
#include "data/provenance.h"
#include "data/study.h"

namespace unfurl::study {

// A study made ready to be fitted: its trials read, its models compiled or its program found.
struct BoundStudy {
  std::vector<std::shared_ptr<correlate::Model>> models;
  std::vector<std::unique_ptr<correlate::Observations>> observations;
  correlate::FitProblem problem;  // points into the above
  correlate::FitOptions options;
  std::vector<std::string> inputs;  // every file that the result depends on
  std::vector<correlate::ToleranceChoice>
      tolerance;  // by trial; empty: a program, or given in the study
};

// `tracks` takes the place of the study's (of one trial). `rivals`: with the laws of loss that the
// scene's joints lack, which costs a run for each trial where there are any. Throws Error for what
// does not fit together.
BoundStudy Bind(const data::Study& study, const std::string& tracks, bool rivals = false);

// All that the answers to evaluations depend on, as text: program, inputs' hashes, settings.
std::string IdentityOf(const data::Provenance& provenance);

}  // namespace unfurl::study
