#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/interval.h"
#include "correlate/hierarchy/normal_mixture.h"

namespace unfurl::correlate {

/// Points of the distribution of Cochran's Q over N trials, chi-square with N - 1 degrees of
/// freedom, by which the scatter's confidence distribution is summed up. They depend on N alone.
struct ScatterLevels {
  explicit ScatterLevels(Eigen::Index trials);  ///< at least 2
  Eigen::Index trials;
  Eigen::VectorXd q;             ///< falling, so that the scatter rises [-]
  Eigen::VectorXd weight;        ///< sums to 1 [-]
  double low = 0.0, high = 0.0;  ///< 2.5% and 97.5% quantiles of Q [-]
};

/// One quantity y of N trials of one structure: y_i ~ N(mu, tau^2 + variance_i), where the
/// variances are those of the trials' own errors, and known. An error that all trials have in
/// common (variance `shared`) does not show in their differences and does not average out.
///
/// The scatter tau: interval by Q-profile [Viechtbauer 2007], exact for any N and tau > 0 (97.5% at
/// tau = 0); value by [Paule and Mandel 1982]. The Q-profile at all levels is a confidence
/// distribution of tau [Nagashima et al. 2019], and given tau the mean is normal about the weighted
/// one: mean and next trial are mixtures over it. Where a level of Q is above the Q that was found,
/// tau is 0 and the mean's variance is scaled by their ratio: with equal variances the mean's
/// interval is then Student's, as that of [Hartung and Knapp 2001], for any tau; with unequal ones
/// it keeps what that one loses (docs/decisions/112-many-trials.md).
class RandomEffect {
 public:
  /// Throws Error for fewer than two trials, levels of another number of trials, or a variance that
  /// is not positive and finite.
  RandomEffect(Eigen::VectorXd value, Eigen::VectorXd variance, double shared,
               const ScatterLevels& levels);

  Eigen::Index trials() const { return value_.size(); }          ///< N
  const Eigen::VectorXd& value() const { return value_; }        ///< N
  const Eigen::VectorXd& variance() const { return variance_; }  ///< N

  /// Cochran's Q, the sum of squares about the weighted mean in the trials' own standard errors,
  /// with a scatter of variance `tau2` in them [-].
  double Q(double tau2) const;
  /// The probability of a Q(0) as large as this, or larger, in trials that are alike.
  double AlikeP() const;
  double Scatter() const { return scatter_; }  ///< tau
  /// 95%; both ends 0 where the trials are more alike than their errors say (TooAlike).
  Interval Scatter95() const;
  /// As in 2.5% of trials that are alike: their own errors are stated too large, or they are not
  /// independent. The intervals are then shorter than those errors warrant.
  bool TooAlike() const;
  /// What the trials' own errors let be seen: the scatter by which the expected Q(0) is its 97.5%
  /// quantile in trials that are alike.
  double Visible() const;

  double Value() const { return mean_; }  ///< weighted mean at Scatter()
  NormalMixture Mean() const;             ///< `shared` included
  /// The true value in the next trial, `shared` included.
  NormalMixture Next() const;
  /// The true value in trial i, by its own data and by the other trials', less the shared error.
  NormalMixture Effect(Eigen::Index i) const;
  /// What another trial's estimate, of own variance `variance`, will be.
  NormalMixture NextEstimate(double variance) const;

 private:
  double WeightedMean(double tau2, double* variance) const;
  double ScatterAt(double q, double from) const;  // tau^2 where Q is q, from `from` on

  Eigen::VectorXd value_, variance_;
  double shared_ = 0.0, q0_ = 0.0, scatter_ = 0.0, mean_ = 0.0;
  ScatterLevels levels_;
  Eigen::VectorXd tau2_, center_, center_variance_;  // at the levels
};

/// What the other trials predict of trial i's own estimate, and where it lies.
struct LeftOut {
  double log_density = 0.0;  ///< of its estimate
  double p = 1.0;            ///< two-sided, of a value as far out, or farther
};
/// Throws Error for fewer than three trials.
std::vector<LeftOut> LeaveOneOut(const Eigen::VectorXd& value, const Eigen::VectorXd& variance);

}  // namespace unfurl::correlate
