#pragma once

#include <functional>
#include <string>
#include <vector>

#include "correlate/fit/reduced_problem.h"
#include "correlate/fit/slopes.h"

namespace unfurl::correlate {

struct SolverOptions {
  int max_iterations = 25;
  double step_tolerance = 0.02;     // of each parameter's standard error
  bool central_from_start = false;  // else the first differences are one-sided
  double difference_target = 0.0;   // RMS change of the rows by one difference step [-]
  Eigen::VectorXd floor;            // beside the standard error, in u; empty: nothing is
  std::vector<bool> held;           // by parameter: true stays where it is; empty: none
  /// Carried from solution to solution, instead of bought at every point; null: begins without.
  Slopes* slopes = nullptr;
  /// Whether a solution that was found on carried slopes has to stand on bought ones.
  bool verify = true;
  /// Another solution of the same data follows: ends where slopes foretold a step well enough to be
  /// carried on.
  bool leads = false;
  std::function<void(double cost, const std::vector<double>& u)> on_iteration;
};

enum class SolverStatus { kConverged, kStartFailed, kGaveUp };

struct SolverResult {
  SolverStatus status = SolverStatus::kStartFailed;
  std::vector<double> u;
  Eigen::VectorXd sigma;  // standard errors of u by the last sensitivities; empty: there were none
  double cost = 0.0;
  int iterations = 0;
  std::string message;
};

// Trust region with bounds (Ceres, Levenberg-Marquardt) over the reduced problem.
SolverResult Solve(ReducedProblem& problem, const std::vector<Parameter>& parameters,
                   const std::vector<double>& start, const SolverOptions& options);

// The Gauss-Newton step and the standard errors that projected sensitivities give, the latter
// scaled where the residuals are larger than their sigmas. A parameter at a bound that would step
// outside stays.
struct GaussNewton {
  Eigen::VectorXd step;
  Eigen::VectorXd sigma;
};
GaussNewton StepAndSigma(const Eigen::MatrixXd& projected, const Eigen::VectorXd& residual);

// The step that stays within the bounds, by the values: where one is in the way, the way to it is
// all there is to go, and the other values go with it. `sigma` as without bounds.
GaussNewton StepWithin(const std::vector<Parameter>& parameters, const std::vector<double>& u,
                       const Eigen::MatrixXd& projected, const Eigen::VectorXd& residual);

}  // namespace unfurl::correlate
