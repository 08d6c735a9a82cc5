#pragma once

#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/search.h"

namespace unfurl::correlate {

// Where the model's own noise is more than a third of the marks' sigma, it is added to their
// covariance: after many impacts the motion answers to the last digit of every parameter, and what
// the simulation says there is no more than a guess. Empty result: nothing to do.
std::vector<LessWeight> WeighSections(const Observations& all, const Prediction& plain,
                                      const Prediction& tight, int sections, Observations* out);

// Two-sided differences at the estimate, the finer models and what else is wanted beside them.
// False: a model failed there, and the result says so.
bool FillEstimate(const FitProblem& problem, StageRunner& runner,
                  std::vector<Evaluator::Request> beside, FitResult* r);

// Questions to the rival laws at the estimate, and to the model that they differ from.
std::vector<Evaluator::Request> RivalRequests(const FitProblem& problem,
                                              const std::vector<double>& theta);
// What they answer.
void FillRivals(const FitProblem& problem, StageRunner& runner, FitResult* r);

}  // namespace unfurl::correlate
