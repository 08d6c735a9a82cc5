#pragma once

#include <Eigen/Core>

#include "correlate/fit/interval.h"

namespace unfurl::correlate {

/// A mixture of normal densities; all in the unit of its variable, variances in its square.
struct NormalMixture {
  Eigen::VectorXd weight;    ///< sums to 1 [-]
  Eigen::VectorXd mean;      ///< of each component
  Eigen::VectorXd variance;  ///< of each, > 0

  double Cdf(double x) const;         ///< [-]
  double LogDensity(double x) const;  ///< natural logarithm [of 1/unit]
  double Mean() const;                ///< [unit]
  /// P-quantile, 0 < p < 1.
  double Quantile(double p) const;
  Interval Middle95() const;  ///< between the 2.5% and 97.5% quantiles
  /// Half of Middle95 over that of a standard normal density. The mixtures of few trials have no
  /// variance (Student's density with two degrees of freedom has none).
  double Sigma() const;
};

}  // namespace unfurl::correlate
