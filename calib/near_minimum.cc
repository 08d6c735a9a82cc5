#include "calib/near_minimum.h"

#include <ceres/problem.h>
#include <ceres/solver.h>

namespace unfurl::calib {
namespace {

// By what the cost, half a chi-square, is above its minimum where the search may end: a tenth of a
// standard error from it in the worst direction [-].
constexpr double kAtMinimum = 0.5 * 0.1 * 0.1;

}  // namespace

template <typename Summary, typename Options>
bool NearMinimum(const Summary& report, Options solver, ceres::Problem* problem) {
  if (report.termination_type == ceres::CONVERGENCE) return true;
  if (report.termination_type != ceres::NO_CONVERGENCE) return false;
  solver.max_num_iterations = 1;
  solver.initial_trust_region_radius = solver.max_trust_region_radius;
  Summary last;
  ceres::Solve(solver, problem, &last);
  if (last.termination_type == ceres::CONVERGENCE) return true;
  if (last.iterations.size() < 2) return false;
  const ceres::IterationSummary& step = last.iterations[1];
  return step.step_is_valid && step.cost_change / step.relative_decrease < kAtMinimum;
}

template bool NearMinimum(const ceres::Solver::Summary&, ceres::Solver::Options, ceres::Problem*);

}  // namespace unfurl::calib
