#pragma once

#include <Eigen/Core>
#include <vector>

#include "correlate/fit/parameter.h"
#include "correlate/model.h"
#include "correlate/observations.h"

namespace unfurl::correlate {

/// What a fine rung of a model adds to a coarse one, as a function of the parameters: the
/// difference at one point, with a slope by Broyden's rank-one update where one is wanted. Additive
/// correction of multi-fidelity models [Alexandrov and Lewis 2001, Optim. Eng. 2, 413-430; Broyden
/// 1965, Math. Comp. 19, 577-593].
class Correction {
 public:
  /// Fine less coarse at one point, by trial: positions [m], velocities [m/s] of all marks and
  /// samples, numbers of the residual kinds (0 where either has none).
  using Difference = std::vector<Eigen::VectorXd>;
  static Eigen::VectorXd DifferenceOf(const Observations& observations, const Prediction& coarse,
                                      const Prediction& fine);

  /// `u`: internal coordinates of the point. Parameters and observations must outlive it.
  Correction(const std::vector<Parameter>& parameters,
             std::vector<const Observations*> observations, Eigen::VectorXd u,
             Difference difference);

  /// Another point is known: the slope takes it in, in steps measured by `sigma` (of u, there), and
  /// the correction is then exact at both. Steps of logarithms are those of the value, in which it
  /// is linear.
  void Learn(const Eigen::VectorXd& u, const Difference& difference, const Eigen::VectorXd& sigma);
  /// The centre goes there; what the slope says of a value stays as it is.
  void MoveTo(const Eigen::VectorXd& u, Difference difference);

  /// `coarse` at the values `theta`, corrected.
  Prediction Apply(std::size_t trial, const std::vector<double>& theta,
                   const Prediction& coarse) const;

  const Eigen::VectorXd& centre() const { return u_; }  // where it is exact
  bool has_slope() const { return !slope_.empty(); }    // beyond a constant

 private:
  Eigen::VectorXd At(std::size_t trial, const Eigen::VectorXd& u) const;

  const std::vector<Parameter>& parameters_;
  std::vector<const Observations*> observations_;  // by trial
  Eigen::VectorXd u_;                              // internal coordinates [-, units]
  Difference difference_;
  std::vector<Eigen::MatrixXd>
      slope_;  // by trial, rows of the difference x parameters, per ValueStep from u_; empty: none
};

}  // namespace unfurl::correlate
