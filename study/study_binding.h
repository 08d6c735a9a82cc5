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

// What a study is bound for. A version of one that was fitted is asked for no laws of loss that the
// scene's joints lack (a run for each trial where there are any), and its data's units are not
// doubted: that it moves at another pace than the data is what it is asked for.
enum class BindFor { kFit, kVersion };

// `tracks` takes the place of the study's (of one trial). Throws Error for what does not fit
// together.
BoundStudy Bind(const data::Study& study, const std::string& tracks, BindFor what);

// All that the answers to evaluations depend on, as text: program, inputs' hashes, settings.
std::string IdentityOf(const data::Provenance& provenance);

}  // namespace unfurl::study
