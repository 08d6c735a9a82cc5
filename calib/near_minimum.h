#pragma once

namespace ceres {
class Problem;
}

namespace unfurl::calib {

// Whether a search has come so near to its minimum that nothing which anybody reads of it depends
// on the rest: it ended by its tolerances, or, out of iterations, one step without damping would
// lower the cost, half a chi-square, by next to nothing, as its linear model has it. Long rows
// leave curved valleys along which the search creeps, far within all error bars. The step is taken
// if it does what it promises. `report`: a ceres::Solver::Summary, how the search with `solver`, a
// ceres::Solver::Options, ended; for these two alone, which no header can name.
template <typename Summary, typename Options>
bool NearMinimum(const Summary& report, Options solver, ceres::Problem* problem);

}  // namespace unfurl::calib
