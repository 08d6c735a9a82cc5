#pragma once

#include <cstddef>
#include <vector>

#include "correlate/fit/fit.h"
#include "correlate/fit/screening.h"

namespace unfurl::correlate {

// Which of several starts a fit carries on.

// The points to screen: the study's own start first, then those of the hypercube.
std::vector<std::vector<double>> PointsToScreen(const FitProblem& problem,
                                                const SearchOptions& search);

// The `wanted` usable candidates of least misfit, best first. The study's own start is always among
// them where it is usable: a person chose it.
std::vector<std::size_t> ChooseCandidates(const std::vector<Candidate>& candidates, int wanted);

// The points of least cost, at most `wanted`, none within a twentieth of the range of every
// parameter of one that is better.
std::vector<std::size_t> SeparatePoints(const std::vector<Parameter>& parameters,
                                        const std::vector<std::vector<double>>& points,
                                        const std::vector<double>& costs, std::size_t wanted);

// By rising cost; those that failed last.
void SortByCost(std::vector<StartResult>* starts);

}  // namespace unfurl::correlate
