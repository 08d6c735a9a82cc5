#pragma once

#include "correlate/fit/ladder.h"

namespace unfurl::correlate {

/// What (top - below) is to be multiplied by for what the top still lacks, e_top / (e_below -
/// e_top)
/// [-]; 0: the rungs' errors are not known.
double Richardson(const FitTrial& trial, std::size_t below, std::size_t top);

/// How far the values may be off for what the finest rung lacks, in u, as far as the rungs at hand
/// tell (the base and the finest, by part of `reduced`): beside it a step need not be small.
/// `J`: sensitivities at `at`.
Eigen::VectorXd FloorOf(const FitProblem& problem, std::size_t base, std::size_t top,
                        const ReducedProblem& reduced, const ReducedProblem::Point& at,
                        const Eigen::MatrixXd& J, const std::vector<Evaluator::Answer>& coarse,
                        const std::vector<Evaluator::Answer>& fine);

/// What the finest rung still lacks, by trial: its change against the rung below, times
/// e_top / (e_below - e_top) where the rungs' errors e are known (Richardson), and the whole change
/// where they are not. A third rung gives a second estimate in the same way; by how much the two
/// differ is the doubt.
///
/// The evaluations that it wants come first, so that they can share a batch with others.
std::vector<Evaluator::Request> RungsWanted(const FitProblem& problem, const Ladder& ladder,
                                            const StageRunner& runner);
void FillWhatIsLeft(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
                    FitResult* result);

/// By how much the values move with what the finest rung still lacks, beyond the first order.
struct WaysOfError {
  Eigen::VectorXd first, second;  ///< by its two estimates, by parameter, in its unit; empty: as
                                  ///< the first order has it
  Eigen::VectorXd bend;  ///< how far it was followed beyond the first order without an end,
                         ///< likewise: a doubt; empty: none
  int rounds = 0;        ///< that it took to follow them
};
/// From the end of the shift that `result` has to first order, the extrapolated model, fine + r
/// (fine - below), is led to its minimum by Gauss-Newton steps with the sensitivities at hand, one
/// run of each rung a trial and step: what the finest rung lacks depends on the place, and the
/// sensitivities are the lowest rung's. A shift that is small beside data and doubt stays as it is.
WaysOfError FollowError(const FitProblem& problem, const Ladder& ladder, StageRunner& runner,
                        const FitResult& result);

}  // namespace unfurl::correlate
