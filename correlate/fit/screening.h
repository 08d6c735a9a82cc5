#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "correlate/fit/evaluator.h"
#include "correlate/fit/fit.h"

namespace unfurl::correlate {

// `count` points in the box of the parameters' bounds, as values: each parameter's range (of its
// logarithm where that is what moves) is cut into `count` parts of which each holds one point
// [McKay, Beckman and Conover 1979]. Throws Error for a parameter without finite bounds.
std::vector<std::vector<double>> LatinHypercube(const std::vector<Parameter>& parameters,
                                                std::size_t count, std::uint64_t seed);

// A place from which the fit can be carried on: where in time and space the data sit beside the
// model at `theta`.
struct Candidate {
  std::vector<double> theta;
  std::vector<Alignment> alignment;  // by trial
  bool usable = false;
  double misfit = 0.0;  // mean square of the residuals in sigmas over the first horizon
  std::string message;  // why not usable
  bool failed = false;  // the model could not be evaluated
};

// Where a model is asked so that a trial can be laid beside it.
Stamps AlignmentGrid(const Observations& o, const FitOptions& options);

// Simulates and aligns each; all simulations in one batch. `beside` are run in the same batch and
// their answers given back.
std::vector<Candidate> Screen(const FitProblem& problem, const FitOptions& options,
                              const std::vector<std::vector<double>>& points, Evaluator& evaluator,
                              const std::vector<Evaluator::Request>& beside,
                              const std::vector<Stamps>& beside_stamps,
                              std::vector<Evaluator::Answer>* beside_answers);

}  // namespace unfurl::correlate
