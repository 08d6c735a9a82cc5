#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "correlate/hierarchy/random_effect.h"

namespace unfurl::correlate {

/// What one trial by itself says of p parameters, in the coordinates in which they scatter normally
/// (logarithms where the fit moves those).
struct TrialEstimate {
  std::string name;
  Eigen::VectorXd value;       ///< p
  Eigen::MatrixXd covariance;  ///< p x p, of the trial's own errors: what differs between trials
};

/// Trials of one structure whose parameters are drawn from one normal density.
struct HierarchyProblem {
  std::vector<TrialEstimate> trials;
  Eigen::MatrixXd shared;  ///< p x p: covariance of the error that all trials have in common
  /// p, by parameter: whether it scatters; the others have one value in all trials. Empty: all do.
  std::vector<bool> scatters;
};

/// One parameter over the trials.
struct ParameterScatter {
  bool scatters = true;
  double value = 0.0;            ///< mean over all deployments; of one value for all, that value
  double sigma = 0.0;            ///< of the value: half of its 95% interval over 1.96
  Interval mean95;               ///< of the value
  double scatter = 0.0;          ///< standard deviation from trial to trial
  Interval scatter95;            ///< of that
  double visible = 0.0;          ///< a scatter that the trials' own errors let be seen
  bool too_alike = false;        ///< more alike than the trials' own errors say
  double q = 0.0;                ///< Cochran's Q, N - 1 degrees of freedom [-]
  double alike_p = 1.0;          ///< of a Q as large, or larger, in trials that are alike
  Interval next95;               ///< the true value in the next trial
  std::vector<double> estimate;  ///< by trial: by its own data, the parameters of one value held
  std::vector<double> own;       ///< standard error of that
  std::vector<double> effect;    ///< by trial: shrunken
  std::vector<Interval> effect95;
  std::vector<LeftOut> left_out;  ///< by trial, by the others
};

/// What N trials say together.
class Hierarchy {
 public:
  /// Throws Error for fewer than three trials, covariances that are not positive definite, numbers
  /// that are not finite, or sizes that do not go together.
  explicit Hierarchy(const HierarchyProblem& problem);

  /// p, in the order of the problem.
  const std::vector<ParameterScatter>& parameters() const { return parameters_; }
  double q() const { return q_; }              ///< Cochran's Q of all parameters together [-]
  double freedom() const { return freedom_; }  ///< its degrees of freedom, p (N - 1)
  /// Probability of so large a Q where trials are alike [-].
  double alike_p() const { return alike_p_; }
  /// Of the values, correlations by generalised least squares [unit x unit].
  const Eigen::MatrixXd& covariance() const { return covariance_; }
  /// By trial: the least p of its scattering parameters left out, times their number.
  const std::vector<double>& unlike_p() const { return unlike_p_; }

  /// A quantity that is linear in the parameters, direction' theta, over the trials: by itself a
  /// random effect, however the parameters are correlated. `direction` has p.
  /// The trials must say something of it: throws Error where a variance is 0.
  RandomEffect Along(const Eigen::VectorXd& direction) const;
  /// The 95% interval of it in the next trial, give or take a further error of variance
  /// `extra_variance` (a sample's own). A direction of 0, or of parameters of one value alone, is
  /// allowed.
  Interval NextAlong(const Eigen::VectorXd& direction, double extra_variance = 0.0) const;

 private:
  void HoldCommon(const HierarchyProblem& problem);
  void TestAlike(const HierarchyProblem& problem);
  void Combine();

  ScatterLevels levels_;
  std::vector<bool> scatters_;
  std::vector<TrialEstimate> trials_;  // given the parameters of one value
  Eigen::MatrixXd shared_;             // with what the errors of those do to the others
  std::vector<ParameterScatter> parameters_;
  Eigen::MatrixXd covariance_;
  double q_ = 0.0, freedom_ = 0.0, alike_p_ = 1.0;
  std::vector<double> unlike_p_;
};

}  // namespace unfurl::correlate
