#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/reduced_problem.h"

namespace unfurl::correlate {

/// What the model's answers change by per unit of each parameter, carried from point to point: two
/// runs a parameter buy them, and each step that is taken anyway mends them along its direction
/// [Broyden 1965, Math. Comp. 19, 577-593; least change in standard errors].
class Slopes {
 public:
  /// None are known until Buy.
  bool known() const { return !change_.empty(); }
  /// Bought at the point where they stand; not carried there.
  bool fresh() const { return known() && fresh_; }
  void Forget() {
    change_.clear();
    kinks_.clear();
  }
  /// What they describe has changed a little.
  void Age() { fresh_ = false; }

  /// Central differences at `at`, and what else goes into the batch. False: a column failed.
  bool Buy(ReducedProblem& problem, const std::vector<double>& u, const ReducedProblem::Point& at,
           const std::vector<Evaluator::Request>& beside = {});
  /// Differences to one side, taken at `at`: good enough to be carried, not to stand on.
  void Take(ReducedProblem::Changes change, const std::vector<double>& u,
            const ReducedProblem::Point& at);
  /// To the first point of a solution. Its stamps, weights or correction may be others: nothing is
  /// learnt. Slopes of other samples are forgotten.
  void StartAt(const ReducedProblem& problem, const std::vector<double>& u,
               const ReducedProblem::Point& at);
  /// To the next point, learning from it where the step moves the rows by at least `target` RMS:
  /// differences over less tell less than the slopes knew.
  void MoveTo(const ReducedProblem& problem, const std::vector<double>& u,
              const ReducedProblem::Point& at, double target);

  /// d residual / d u before projection, at the point where they stand.
  Eigen::MatrixXd Rows(const ReducedProblem& problem) const {
    return problem.RowsOf(u_, at_, change_);
  }
  /// Of the change that the last step learnt from, the part that had not been foretold [-]; 0:
  /// none.
  double mismatch() const { return mismatch_; }
  /// Where they were bought, by parameter: |forward - backward| over |forward + backward| [-];
  /// empty: they were not.
  const std::vector<double>& kinks() const { return kinks_; }

 private:
  // What a value's change does stays; per unit of a logarithm it grows with the value.
  void StandAt(const ReducedProblem& problem, const std::vector<double>& u,
               const ReducedProblem::Point& at);

  ReducedProblem::Changes change_;  // by part and parameter
  std::vector<double> u_;           // where they stand
  ReducedProblem::Point at_;
  bool fresh_ = false;
  double mismatch_ = 0.0;
  std::vector<double> kinks_;
};

/// The rank-one update (BroydenWeights): `change`, by part and parameter, then foretells the step
/// `by` from one point to the other. `sigma`: of u.
void LearnStep(const ReducedProblem& problem, const ReducedProblem::Point& from,
               const ReducedProblem::Point& to, const Eigen::VectorXd& by,
               const Eigen::VectorXd& sigma, ReducedProblem::Changes* change);

}  // namespace unfurl::correlate
