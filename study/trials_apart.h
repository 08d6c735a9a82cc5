#pragma once

#include <string>
#include <vector>

#include "correlate/fit/fit.h"

namespace unfurl::study {

/// Whether it is one of several trials that keeps the model from explaining them together.
struct TrialsApart {
  std::string verdict;               ///< "the data of trial 2 beside the others'"; empty: it is not
  std::vector<std::string> reasons;  ///< which, and whether its clock would make up for it
};

/// The model explains every trial.
bool ExplainsAll(const correlate::FitResult& r);
/// "inertia 0.0833 ± 0.0001 kg m^2 and damping ..".
std::string ValuesOf(const correlate::FitProblem& problem, const correlate::FitResult& r);
/// The same with the estimate for its start; and how to fit it again from there and nowhere else,
/// without profiles.
correlate::FitProblem FromEstimate(const correlate::FitProblem& problem,
                                   const correlate::FitResult& r);
correlate::FitOptions NoSearch(correlate::FitOptions options);

/// Of a fit that does not explain all of its trials: each trial is left out in turn and the others
/// fitted from the estimate. Where they are explained without one, it is laid beside their values
/// with a clock of which nothing is said. One fit a trial and one or two more, without profiles, on
/// threads of this machine; none where there is one trial, or all are explained.
TrialsApart FindTrialsApart(const correlate::FitProblem& problem,
                            const correlate::FitOptions& options, const correlate::FitResult& r);

/// Of a fit whose trials could not be aligned at the start: which of them, and whether two of its
/// marks have one another's names. A simulation a trial.
std::vector<std::string> WhyNotAligned(const correlate::FitProblem& problem,
                                       const correlate::FitOptions& options,
                                       const correlate::FitResult& r);

}  // namespace unfurl::study
